"""Requests of streams, for both kinds of client."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping, Sequence

from taclink._calls import names
from taclink.errors import InvalidArgument
from taclink.messages.events import EventPlace
from taclink.names import Detail, EventKind, number_of
from taclink.v1 import attitude_pb2, events_pb2, geometry_pb2, joints_pb2, pressure_pb2, recording_pb2, tactile_pb2


def frames(
    links: str | Iterable[str],
    detail: str,
    max_rate_hz: float,
    every: bool,
    deadband_force_n: float,
    deadband_move_m: float,
) -> tactile_pb2.StreamFramesRequest:
    return tactile_pb2.StreamFramesRequest(
        links=names(links),
        detail=number_of(Detail, detail, "detail"),
        max_rate_hz=max_rate_hz,
        delivery=tactile_pb2.DELIVERY_EVERY if every else tactile_pb2.DELIVERY_LATEST,
        deadband_force_n=deadband_force_n,
        deadband_move_m=deadband_move_m,
    )


def max_age(max_age_s: float | None) -> float | None:
    """Of frames(). Errors: InvalidArgument."""
    if max_age_s is not None and not 0 < max_age_s < math.inf:
        raise InvalidArgument(f"max_age_s must be a positive number of seconds, or None for any age, not {max_age_s}")
    return max_age_s


def events(
    links: str | Iterable[str], kinds: str | Iterable[str], after: EventPlace | None
) -> events_pb2.StreamEventsRequest:
    request = events_pb2.StreamEventsRequest(
        links=names(links), kinds=[number_of(EventKind, kind, "an event's kind") for kind in names(kinds)]
    )
    if after is not None:
        request.run_id = after.run_id
        request.after_sequence = after.after_sequence
    return request


def replay(
    log: str,
    links: str | Iterable[str],
    detail: str,
    from_utc_ns: int,
    to_utc_ns: int,
    speed: float,
    loop: bool,
    paused: bool,
    without: Mapping[str, bool],
) -> recording_pb2.ReplayRequest:
    return recording_pb2.ReplayRequest(
        log=log,
        links=names(links),
        detail=number_of(Detail, detail, "detail"),
        from_utc_ns=from_utc_ns,
        to_utc_ns=to_utc_ns,
        speed=speed,
        loop=loop,
        paused=paused,
        **{f"without_{what}": unwanted for what, unwanted in without.items()},
    )


def joint_states(
    positions: Mapping[str, float] | Sequence[float],
    velocities: Mapping[str, float] | Sequence[float] | None,
    names: Sequence[str] | None,
    utc_ns: int | None,
    monotonic_ns: int | None,
) -> joints_pb2.UpdateJointStatesRequest:
    """Without a time: now, by this machine's clock. Mappings name the joints themselves."""
    request = joints_pb2.UpdateJointStatesRequest()
    if isinstance(positions, Mapping):
        request.names.extend(positions)
        request.positions.extend(positions.values())
    else:
        request.names.extend(names or ())
        request.positions.extend(positions)
    if isinstance(velocities, Mapping):
        if set(velocities) != set(request.names):
            raise InvalidArgument("velocities must be of the same joints as positions")
        request.velocities.extend(velocities[name] for name in request.names)
    elif velocities is not None:
        request.velocities.extend(velocities)
    if monotonic_ns is not None:
        request.monotonic_ns = monotonic_ns
    else:
        request.utc_ns = time.time_ns() if utc_ns is None else utc_ns
    return request


def pressure(
    pressure_pa: float, link: str, utc_ns: int | None, monotonic_ns: int | None
) -> pressure_pb2.UpdatePressureRequest:
    return pressure_pb2.UpdatePressureRequest(
        pressure_pa=pressure_pa, link=link, utc_ns=utc_ns, monotonic_ns=monotonic_ns
    )


def attitude(
    specific_force_mps2: Sequence[float],
    sigma_mps2: float,
    link: str,
    utc_ns: int | None,
    monotonic_ns: int | None,
) -> attitude_pb2.UpdateAttitudeRequest:
    if len(specific_force_mps2) != 3:
        raise InvalidArgument(f"a specific force has 3 components, not {len(specific_force_mps2)}")
    x, y, z = specific_force_mps2
    return attitude_pb2.UpdateAttitudeRequest(
        specific_force_mps2=geometry_pb2.Vector3(x=x, y=y, z=z),
        sigma_mps2=sigma_mps2,
        link=link,
        utc_ns=utc_ns,
        monotonic_ns=monotonic_ns,
    )
