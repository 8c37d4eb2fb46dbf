"""Pressure regulators of links."""

from __future__ import annotations

from dataclasses import dataclass

from taclink.messages.arrays import alike, optional
from taclink.names import PressureTripCause, RegulatorState, name_of
from taclink.v1 import pressure_pb2


@dataclass(frozen=True, kw_only=True, slots=True)
class PressureTrip:
    """Why a regulator closed its valve and vented the skin."""

    cause: PressureTripCause
    text: str  # what was measured, the limit, and what to do
    measured: float | None  # Pa; s of SENSOR_LOST and LOOP_STALLED; a share of LEAK
    limit: float | None
    utc_ns: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Regulator:
    """Sets the pressure inside a skin. Gauge pressures, Pa."""

    state: RegulatorState
    target_pa: float | None  # asked for; None: the valve is closed
    setpoint_pa: float | None  # commanded now, on its way there; likewise
    ramp_pa_per_s: float
    measured_pa: float | None  # the newest reading; None: there is none
    age_s: float | None  # of the reading
    effort: float | None  # share of the valve's range in use; None: not reported
    trip: PressureTrip | None  # of the state TRIPPED
    trouble: str  # of the line or the readings; empty: none
    min_pa: float  # configured limits
    max_pa: float
    max_ramp_pa_per_s: float


def _trip_from(message: pressure_pb2.PressureTrip) -> PressureTrip:
    return alike(
        PressureTrip,
        message,
        cause=name_of(PressureTripCause, message.cause),
        measured=optional(message, "measured"),
        limit=optional(message, "limit"),
    )


def regulator_from(message: pressure_pb2.PressureRegulator) -> Regulator:
    return alike(
        Regulator,
        message,
        state=name_of(RegulatorState, message.state),
        target_pa=optional(message, "target_pa"),
        setpoint_pa=optional(message, "setpoint_pa"),
        measured_pa=optional(message, "measured_pa"),
        age_s=optional(message, "age_s"),
        effort=optional(message, "effort"),
        trip=_trip_from(message.trip) if message.HasField("trip") else None,
    )
