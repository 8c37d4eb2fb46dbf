"""The client that blocks. SI units: m, N, Pa, s, rad; times in ns since 1970-01-01 UTC."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType

import grpc

from taclink import _calls, _channel, _requests, errors
from taclink._blocking import Connection
from taclink._channel import DEFAULT_ADDRESS, FilePath
from taclink._download import Download
from taclink._patience import CALL_S, SLOW_S, chosen_s
from taclink._reconnect import OnReconnect, attempts
from taclink.messages.arm import Arm
from taclink.messages.baseline import CalibrationResult, LinkTare, calibration_from
from taclink.messages.events import EventPlace
from taclink.messages.force_level import ForceLevelState
from taclink.messages.history import ForceHistory
from taclink.messages.others import Caller
from taclink.messages.pressure import Regulator
from taclink.messages.recording import Log, LogDescription, RecorderStatus
from taclink.streams import (
    AttitudeWriter,
    ContactStream,
    EventStream,
    FrameStream,
    JointStateWriter,
    PressureWriter,
    PreviewStream,
    Replay,
)
from taclink.v1 import contacts_pb2, preview_pb2


class Client:
    """A connection to one server; `with Client() as client:`, or close().

    address: host:port, or unix:PATH. It is connected to with the first call.
    token: shows who calls; never sent in the clear to another machine.
    ca_file: PEM; the server's certificate must be signed by one of these. None: no TLS.
    certificate_file, key_file: PEM; this client's own, for servers that ask for one.
    timeout: s that a call, or the beginning of a stream, may take; None: 10 s. What takes longer by nature has its
    own; None: 60 s. For None, the environment variable TACLINK_PATIENCE_S, a number of seconds, raises the limit on
    slow machines; it also raises the limit of 5 s for the server's answer to a keepalive ping.

    Errors of all methods, beside those they name (all TaclinkError): Unavailable, Timeout, Unauthenticated,
    PermissionDenied; of streams also ResourceExhausted. Errors of the constructor: InvalidArgument (also where
    TACLINK_PATIENCE_S is not a positive number), NotFound (a file).
    Calls may come from several threads; one stream belongs to one.
    """

    def __init__(
        self,
        address: str = DEFAULT_ADDRESS,
        *,
        token: str | None = None,
        ca_file: FilePath | None = None,
        certificate_file: FilePath | None = None,
        key_file: FilePath | None = None,
        timeout: float | None = None,
    ) -> None:
        settings = _channel.settings(address, token, ca_file, certificate_file, key_file)
        self._connection = Connection(settings, chosen_s(timeout, CALL_S))

    @property
    def address(self) -> str:
        """As given."""
        return self._connection.address

    def close(self) -> None:
        """Ends all streams of this client, too."""
        self._connection.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # What the arm is and does.

    def arm(self) -> Arm:
        """The links, their models and poses, how they do now; joints of the URDF."""
        return self._connection.ask(_calls.arm())

    def frames(
        self,
        links: str | Iterable[str] = (),
        detail: str = "contacts",
        *,
        max_rate_hz: float = 0,
        every: bool = False,
        deadband_force_n: float = 0,
        deadband_move_m: float = 0,
        max_age_s: float | None = None,
        reconnect: bool = False,
        on_reconnect: OnReconnect = None,
    ) -> FrameStream:
        """Frames of links as they are solved; link frame.

        links: names; none: all. detail: "contacts", "geometry" (and positions) or "full" (and displacements,
        covariances, nodal forces). max_rate_hz: of each link; 0: all. every: all wait in order in a bounded
        queue; else only the newest of each link waits. A link that changes by less than the deadbands (N of a
        contact's force, m of a marker) is sent once a second only (Frame.unchanged); both 0: always.
        max_age_s: frames whose latency_s is larger when they come here are left out and counted
        (FrameStream.too_old); None: any age. That is as right as both machines' clocks agree: keep them synchronized
        much closer than max_age_s (NTP, PTP). Frames of a log have no age.
        reconnect: a broken stream is reopened, with growing pauses, until it is closed; before each try
        on_reconnect(error, attempt, delay_s) is called. The first opening is not retried.

        Errors: NotFound (no such link), InvalidArgument.
        """
        request = _requests.frames(links, detail, max_rate_hz, every, deadband_force_n, deadband_move_m)
        return FrameStream(
            self._connection,
            request,
            self._connection.timeout_s,
            attempts(reconnect, on_reconnect),
            _requests.max_age(max_age_s),
        )

    def contacts(
        self, max_rate_hz: float = 0, *, reconnect: bool = False, on_reconnect: OnReconnect = None
    ) -> ContactStream:
        """All contacts of the arm in its base frame, and the joint torques that they cause.

        The first at once, then whenever a link publishes, at most max_rate_hz (0: no limit) and at least once a
        second. reconnect: as of frames().
        """
        request = contacts_pb2.StreamContactsRequest(max_rate_hz=max_rate_hz)
        return ContactStream(
            self._connection, request, self._connection.timeout_s, attempts(reconnect, on_reconnect)
        )

    def events(
        self,
        links: str | Iterable[str] = (),
        kinds: str | Iterable[str] = (),
        *,
        after: EventPlace | None = None,
        reconnect: bool = False,
        on_reconnect: OnReconnect = None,
    ) -> EventStream:
        """What happens to links, each event at least once.

        links, kinds: names (kinds: of EventKind); none: all. after: what came after that place, for which
        EventStream.place is; EventPlace(): all that the server still has; None: from now on. reconnect: as of
        frames(); the stream goes on after the last event that was had.

        Errors: NotFound (no such link), InvalidArgument.
        """
        request = _requests.events(links, kinds, after)
        return EventStream(
            self._connection, request, self._connection.timeout_s, attempts(reconnect, on_reconnect)
        )

    def preview(self, link: str, max_rate_hz: float = 0) -> PreviewStream:
        """What a link's cameras see, and the markers found there; at most max_rate_hz (to 30; 0: 5) a second.

        Errors, at the first picture: NotFound (no such link), InvalidArgument, Refused (a log is played).
        """
        request = preview_pb2.StreamPreviewRequest(link=link, max_rate_hz=max_rate_hz)
        return PreviewStream(self._connection, request, self._connection.timeout_s)

    def force_history(
        self, links: str | Iterable[str] = (), *, span_s: float = 60
    ) -> tuple[ForceHistory, ...]:
        """How strongly links (none: all) were pressed in the last `span_s` seconds, at most 300."""
        return self._connection.ask(_calls.force_history(links, span_s))

    def caller(self) -> Caller:
        """Who the server takes this client for."""
        return self._connection.ask(_calls.caller())

    # What operators do.

    def tare(
        self,
        links: str | Iterable[str] = (),
        *,
        force: bool = False,
        frames: int = 10,
        undo: bool = False,
        timeout: float | None = None,
    ) -> tuple[LinkTare, ...]:
        """Makes what the links show now (none: all) their untouched skins, each accepted or refused for itself.

        force: even while touched, moved or with few markers. frames: to average over, 1 to 300. undo: undoes the
        last tare instead, once.
        Errors: NotFound (no such link), InvalidArgument.
        """
        return self._connection.ask(_calls.tare(links, force, frames, undo, timeout))

    def calibrate(
        self,
        link: str,
        *,
        pairs: int = 8,
        repeats: int = 1,
        save: bool = False,
        force: bool = False,
        on_progress: Callable[[int, int], object] | None = None,
        timeout: float | None = None,
    ) -> CalibrationResult:
        """Finds a link's cameras and rest shape again; nothing may touch its skin. Waits for the end.

        pairs: of pictures to average over, 1 to 300. repeats: calibrations one after the other, 1 to 100, each of
        so many pairs; their scatter is `parameters[i].standard_deviation`; the link uses the last. save: also write the link's configured calibration file on
        the server. force: even if the newest frame shows contacts. on_progress(taken, wanted): as pairs are
        taken; an exception in it cancels, and then the link stays as it was.
        Errors: NotFound (no such link), InvalidArgument, Refused (touched, moved, does not fit: the message says).
        """
        request = _calls.calibrate_request(link, pairs, repeats, save, force)
        channel = self._connection.channel()
        call = channel.start("tactile", "Calibrate", request, chosen_s(timeout, SLOW_S * max(1, repeats)))
        try:
            for message in call:
                if message.WhichOneof("message") == "result":
                    return calibration_from(message.result)
                if on_progress is not None:
                    on_progress(message.progress.pairs_taken, message.progress.pairs_wanted)
        except grpc.RpcError as error:
            raise self._connection.failure(error, channel) from error
        finally:
            call.cancel()
        raise errors.Internal("the server ended the calibration without a result")

    def set_thresholds(
        self,
        link: str,
        *,
        warning_n: float = 0,
        alarm_n: float = 0,
        hysteresis_n: float = 0.05,
        region: str = "",
    ) -> ForceLevelState:
        """Force thresholds (N; 0: no such level) of a link, or of a region of it, until the server ends.

        Errors: NotFound (no such link or region), InvalidArgument.
        """
        return self._connection.ask(_calls.set_thresholds(link, warning_n, alarm_n, hysteresis_n, region))

    def set_force_model(self, link: str, model: str, *, timeout: float | None = None) -> None:
        """Computes the link's forces by "linear", "pressurised", "nonlinear" or "literal" until the server ends.

        Errors: NotFound (no such link), InvalidArgument, Refused (a log is played; "linear" on a skin that may be
        inflated).
        """
        self._connection.ask(_calls.set_force_model(link, model, timeout))

    def set_camera(
        self,
        link: str,
        camera: str = "",
        *,
        automatic_exposure: bool = False,
        exposure_s: float | None = None,
        gain: int | None = None,
        timeout: float | None = None,
    ) -> None:
        """How "top", "bottom" or (empty) both expose, until the server ends; what is not given stays.

        exposure_s: in steps of 0.1 ms. gain: in the camera's own units. Errors: NotFound (no such link),
        InvalidArgument (also what the camera does not take), Refused (a log is played), Unsupported (nothing to set).
        """
        self._connection.ask(
            _calls.set_camera(link, camera, automatic_exposure, exposure_s, gain, timeout)
        )

    def restart_link(self, link: str) -> None:
        """A fresh source and processor for a link; arm() tells how it goes. Errors: NotFound (no such link)."""
        self._connection.ask(_calls.restart_link(link))

    def press(
        self,
        link: str,
        angle_rad: float,
        z_m: float,
        *,
        depth_m: float | None = None,
        force_n: float | None = None,
        shape: str = "finger",
        diameter_m: float = 0,
        body_id: int = 1,
        hold_s: float = 0,
    ) -> None:
        """Presses a rigid body on a simulated link, or moves one that is there; frames then tell what is true.

        angle_rad, z_m: where on the undeformed skin. depth_m (from where it first touches) or force_n. diameter_m: of
        "sphere" and "disc". hold_s: taken off when no other press() of it comes for so long; 0: it stays. Errors:
        NotFound, InvalidArgument (what is possible is in the message), Refused (the link is not simulated).
        """
        self._connection.ask(
            _calls.press(link, angle_rad, z_m, depth_m, force_n, shape, diameter_m, body_id, hold_s)
        )

    def release(self, link: str, body_id: int = 0) -> None:
        """Takes a body off a simulated link; 0: all. Errors: as press()."""
        self._connection.ask(_calls.release(link, body_id))

    def set_scene_pressure(self, link: str, pressure_pa: float | None) -> None:
        """The gauge pressure inside a simulated skin, 0 to 3000 Pa; None: the scene's. Errors: as press()."""
        self._connection.ask(_calls.set_scene_pressure(link, pressure_pa))

    def move_scene_joint(self, link: str, position_rad: float | None) -> None:
        """Moves the joint of a simulated link's scene; None: as the scene swings it. Errors: as press()."""
        self._connection.ask(_calls.move_scene_joint(link, position_rad))

    def set_pressure(
        self, link: str, pressure_pa: float, *, ramp_pa_per_s: float | None = None, reset_trip: bool = False
    ) -> Regulator:
        """Moves the setpoint of a link's pressure regulator (Pa, gauge) along a ramp, and returns at once.

        ramp_pa_per_s: at most the configured one, which None means. reset_trip: of a regulator that closed its valve
        because a limit was exceeded. Errors: NotFound, InvalidArgument (outside the limits), Refused (the link has no
        regulator, it has tripped, or it gives no reading).
        """
        return self._connection.ask(_calls.set_pressure(link, pressure_pa, ramp_pa_per_s, reset_trip))

    def vent(self, link: str, *, reset_trip: bool = False) -> Regulator:
        """Closes the valve of a link's pressure regulator and vents the skin, at once. Errors: NotFound, Refused."""
        return self._connection.ask(_calls.vent(link, reset_trip))

    def regulator(self, link: str) -> Regulator:
        """The state of a link's pressure regulator. Errors: NotFound, Refused (the link has none)."""
        return self._connection.ask(_calls.regulator(link))

    def update_joint_states(self) -> JointStateWriter:
        """Begins to tell the server where the arm's joints are."""
        return JointStateWriter(self._connection)

    def update_pressure(self) -> PressureWriter:
        """Begins to tell the server the pressure inside skins."""
        return PressureWriter(self._connection)

    def update_attitude(self) -> AttitudeWriter:
        """Begins to tell the server the specific force in links' frames, as an inertial measurement unit knows it."""
        return AttitudeWriter(self._connection)

    # Recordings; they lie on the server.

    def start_recording(
        self,
        name: str = "",
        *,
        links: str | Iterable[str] = (),
        pictures: bool = False,
        compression: str = "configured",
        note: str = "",
        timeout: float | None = None,
    ) -> RecorderStatus:
        """name: part of the logs' names; empty: the arm's. links: none: all. compression: "none", "zstd" or "lz4".

        Errors: Refused (one is under way; no folder is configured), InvalidArgument, NotFound (no such link).
        """
        return self._connection.ask(
            _calls.start_recording(name, links, pictures, compression, note, timeout)
        )

    def stop_recording(self, *, timeout: float | None = None) -> RecorderStatus:
        """Returns when the last log is closed. Errors: Refused (none is under way)."""
        return self._connection.ask(_calls.stop_recording(timeout))

    def recorder(self) -> RecorderStatus:
        """How the server's recorder does."""
        return self._connection.ask(_calls.recorder())

    def logs(self, *, timeout: float | None = None) -> tuple[Log, ...]:
        """In the server's folder, oldest first."""
        return self._connection.ask(_calls.logs(timeout))

    def describe_log(self, log: str, *, timeout: float | None = None) -> LogDescription:
        """What a log holds. Errors: NotFound, DataLoss (damaged)."""
        return self._connection.ask(_calls.describe_log(log, timeout))

    def download_log(
        self,
        log: str,
        path: FilePath,
        *,
        on_progress: Callable[[int, int], object] | None = None,
    ) -> Path:
        """Copies a log into the file or folder `path`; returns the file's path.

        Until it is whole it lies in FILE.download, from which the same call goes on after a break. A file that is
        there is replaced. on_progress(bytes, of). Errors: NotFound, Unavailable (broke off), OSError (the file).
        """
        with Download(log, path) as download:
            channel = self._connection.channel()
            call = channel.start("recording", "DownloadLog", download.request())
            try:
                for piece in call:
                    download.take(piece)
                    if on_progress is not None:
                        on_progress(download.taken, download.size)
            except grpc.RpcError as error:
                raise download.explained(self._connection.failure(error, channel)) from error
            finally:
                call.cancel()
            return download.finish()

    def delete_log(self, log: str) -> None:
        """Errors: NotFound, Refused (it is being written)."""
        self._connection.ask(_calls.delete_log(log))

    def replay(
        self,
        log: str,
        *,
        links: str | Iterable[str] = (),
        detail: str = "full",
        from_utc_ns: int = 0,
        to_utc_ns: int = 0,
        speed: float = 1,
        loop: bool = False,
        paused: bool = False,
        frames: bool = True,
        events: bool = True,
        contacts: bool = True,
        arm: bool = True,
        timeout: float | None = None,
    ) -> Replay:
        """Plays a log: what frames(), contacts() and events() gave then, at its pace, with the times of then.

        links: of frames and events; none: all. from_utc_ns, to_utc_ns: times of the log, both included; 0: its
        first, its last. speed: 0.1 to 100; 0: as fast as it is read. loop: begins again at the end of the range.
        paused: begins so. frames, events, contacts, arm: wanted. timeout: for opening the log.
        Errors: NotFound (no such log or link), InvalidArgument (range, speed), DataLoss (damaged beyond reading).
        """
        without = {"frames": not frames, "events": not events, "contacts": not contacts, "arm": not arm}
        request = _requests.replay(
            log, links, detail, from_utc_ns, to_utc_ns, speed, loop, paused, without
        )
        return Replay(self._connection, request, chosen_s(timeout, SLOW_S))
