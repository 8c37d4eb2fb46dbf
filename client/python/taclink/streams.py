"""Streams and writers of the client that blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from taclink import _calls, _requests
from taclink._blocking import Connection, Stream, Writer
from taclink._reconnect import Attempts
from taclink._streams import ContactState, EventState, FrameState, PreviewState, ReplayState
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


class Replay(ReplayState, Stream[ReplayMessage]):
    """A log that is being played; the first message is a status, the last one has `ended` set.

    Orders may come from any thread, also while the iteration waits; a status tells when one was carried out.
    Errors of orders: NotFound (the replay has ended), InvalidArgument.
    """

    def pause(self) -> None:
        """At once; what is under way still comes."""
        self._order(pause=True)

    def resume(self) -> None:
        """After a pause, or after steps."""
        self._order(pause=False)

    def seek(self, utc_ns: int) -> None:
        """Bounded by the range. The newest frame of each link, up to 2 s before that time, comes first."""
        self._order(seek_utc_ns=utc_ns)

    def step(self, frames: int = 1) -> None:
        """Pauses, and sends so many frames of the link that has the next one, and what lies between; 1 to 1000."""
        self._order(step=frames)

    def set_speed(self, speed: float) -> None:
        """0.1 to 100; 0: as fast as it is read."""
        self._order(speed=speed)

    def set_loop(self, loop: bool) -> None:
        """Whether it begins again at the end of the range."""
        self._order(loop=loop)

    def pictures(self, link: str, utc_ns: int) -> ReplayPictures:
        """The newest that were exposed until then.

        Errors: NotFound (no such link), Refused (the log has none of that link, or none in the 2 s before), DataLoss.
        """
        return self._connection.ask(_calls.replay_pictures(self._player, link, utc_ns))

    def _order(self, **action: object) -> None:
        self._connection.ask(_calls.control_replay(self._player, **action))


class JointStateWriter(Writer[JointStateSummary]):
    """Of Client.update_joint_states()."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection, "UpdateJointStates", joint_summary_from)

    def write(
        self,
        positions: Mapping[str, float] | Sequence[float],
        velocities: Mapping[str, float] | Sequence[float] | None = None,
        *,
        names: Sequence[str] | None = None,
        utc_ns: int | None = None,
        monotonic_ns: int | None = None,
    ) -> None:
        """Where joints are at one instant: rad and rad/s; prismatic: m and m/s.

        positions: by joint, or in the order of names (None: those of the write before). utc_ns, or monotonic_ns of
        the server's machine: that instant; None: now. It must not be before that of the write before.
        Errors: InvalidArgument (no such joint, out of its range, an impossible time), Refused (the arm has no
        URDF). Waits while the server is behind.
        """
        self._write(_requests.joint_states(positions, velocities, names, utc_ns, monotonic_ns))


class PressureWriter(Writer[PressureSummary]):
    """Of Client.update_pressure()."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection, "UpdatePressure", pressure_summary_from)

    def write(
        self,
        pressure_pa: float,
        *,
        link: str = "",
        utc_ns: int | None = None,
        monotonic_ns: int | None = None,
    ) -> None:
        """Gauge pressure inside a link's skin at one instant, Pa.

        link: empty: that of the write before. utc_ns, or monotonic_ns of the server's machine: that instant; None: when
        it arrives. Errors: NotFound (no such link), InvalidArgument, Refused (its pressure comes from elsewhere).
        """
        self._write(_requests.pressure(pressure_pa, link, utc_ns, monotonic_ns))


class AttitudeWriter(Writer[AttitudeSummary]):
    """Of Client.update_attitude()."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection, "UpdateAttitude", attitude_summary_from)

    def write(
        self,
        specific_force_mps2: Sequence[float],
        *,
        sigma_mps2: float = 0,
        link: str = "",
        utc_ns: int | None = None,
        monotonic_ns: int | None = None,
    ) -> None:
        """Gravity less the link's acceleration, link frame, m/s^2; the negative of what an accelerometer reads.

        sigma_mps2: of each component; 0: as configured. link, utc_ns, monotonic_ns and errors: as of
        PressureWriter.write (Refused: its attitude comes from elsewhere).
        """
        self._write(
            _requests.attitude(specific_force_mps2, sigma_mps2, link, utc_ns, monotonic_ns)
        )
