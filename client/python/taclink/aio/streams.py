"""Streams and writers for asyncio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import taclink.streams
from taclink import _calls, _requests
from taclink._reconnect import Attempts
from taclink._streams import ContactState, EventState, FrameState, PreviewState, ReplayState
from taclink.aio._descriptions import described_by
from taclink.aio._waiting import Connection, Stream, Writer
from taclink.messages.contacts import ArmContacts
from taclink.messages.events import Event
from taclink.messages.frame import Frame
from taclink.messages.others import (
    AttitudeSummary,
    JointStateSummary,
    PressureSummary,
    Preview,
    ReplayPictures,
    attitude_summary_from,
    joint_summary_from,
    pressure_summary_from,
)
from taclink.messages.recording import ReplayMessage
from taclink.v1 import tactile_pb2


class FrameStream(FrameState, Stream[Frame]):
    """Of Client.frames()."""

    def __init__(
        self,
        connection: Connection,
        request: tactile_pb2.StreamFramesRequest,
        timeout_s: float,
        attempts: Attempts | None = None,
        max_age_s: float | None = None,
    ) -> None:
        self._max_age_s = max_age_s
        super().__init__(connection, request, timeout_s, attempts)


class ContactStream(ContactState, Stream[ArmContacts]):
    """Of Client.contacts()."""


class EventStream(EventState, Stream[Event]):
    """Of Client.events()."""


class PreviewStream(PreviewState, Stream[Preview]):
    """Of Client.preview()."""


@described_by(taclink.streams.Replay)
class Replay(ReplayState, Stream[ReplayMessage]):
    """A log that is being played; as taclink.Replay. Orders need it open: `async with`, or after the first message."""

    async def pause(self) -> None:
        await self._order(pause=True)

    async def resume(self) -> None:
        await self._order(pause=False)

    async def seek(self, utc_ns: int) -> None:
        await self._order(seek_utc_ns=utc_ns)

    async def step(self, frames: int = 1) -> None:
        await self._order(step=frames)

    async def set_speed(self, speed: float) -> None:
        await self._order(speed=speed)

    async def set_loop(self, loop: bool) -> None:
        await self._order(loop=loop)

    async def pictures(self, link: str, utc_ns: int) -> ReplayPictures:
        return await self._connection.ask(_calls.replay_pictures(self._player, link, utc_ns))

    async def _order(self, **action: object) -> None:
        await self._connection.ask(_calls.control_replay(self._player, **action))


@described_by(taclink.streams.JointStateWriter)
class JointStateWriter(Writer[JointStateSummary]):
    """Of Client.update_joint_states()."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection, "UpdateJointStates", joint_summary_from)

    async def write(
        self,
        positions: Mapping[str, float] | Sequence[float],
        velocities: Mapping[str, float] | Sequence[float] | None = None,
        *,
        names: Sequence[str] | None = None,
        utc_ns: int | None = None,
        monotonic_ns: int | None = None,
    ) -> None:
        await self._write(_requests.joint_states(positions, velocities, names, utc_ns, monotonic_ns))


@described_by(taclink.streams.PressureWriter)
class PressureWriter(Writer[PressureSummary]):
    """Of Client.update_pressure()."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection, "UpdatePressure", pressure_summary_from)

    async def write(
        self,
        pressure_pa: float,
        *,
        link: str = "",
        utc_ns: int | None = None,
        monotonic_ns: int | None = None,
    ) -> None:
        await self._write(_requests.pressure(pressure_pa, link, utc_ns, monotonic_ns))


@described_by(taclink.streams.AttitudeWriter)
class AttitudeWriter(Writer[AttitudeSummary]):
    """Of Client.update_attitude()."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection, "UpdateAttitude", attitude_summary_from)

    async def write(
        self,
        specific_force_mps2: Sequence[float],
        *,
        sigma_mps2: float = 0,
        link: str = "",
        utc_ns: int | None = None,
        monotonic_ns: int | None = None,
    ) -> None:
        await self._write(
            _requests.attitude(specific_force_mps2, sigma_mps2, link, utc_ns, monotonic_ns)
        )
