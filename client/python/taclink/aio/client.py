"""The client for asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType

import grpc

import taclink.client
from taclink import _calls, _channel, _requests, errors
from taclink._channel import DEFAULT_ADDRESS, FilePath
from taclink._download import Download
from taclink._patience import CALL_S, SLOW_S, chosen_s
from taclink._reconnect import OnReconnect, attempts
from taclink.aio._descriptions import described_by
from taclink.aio._waiting import Connection
from taclink.aio.streams import (
    AttitudeWriter,
    ContactStream,
    EventStream,
    FrameStream,
    JointStateWriter,
    PressureWriter,
    PreviewStream,
    Replay,
)
from taclink.messages.arm import Arm
from taclink.messages.baseline import CalibrationResult, LinkTare, calibration_from
from taclink.messages.events import EventPlace
from taclink.messages.force_level import ForceLevelState
from taclink.messages.history import ForceHistory
from taclink.messages.others import Caller
from taclink.messages.pressure import Regulator
from taclink.messages.recording import Log, LogDescription, RecorderStatus
from taclink.v1 import contacts_pb2, preview_pb2


@described_by(taclink.client.Client)
class Client:
    """As taclink.Client, for asyncio: `async with Client() as client:`, or await close().

    Belongs to the event loop in which it is first used.
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

    async def close(self) -> None:
        await self._connection.close()

    async def __aenter__(self) -> Client:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    # What the arm is and does.

    async def arm(self) -> Arm:
        return await self._connection.ask(_calls.arm())

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
        request = _requests.events(links, kinds, after)
        return EventStream(
            self._connection, request, self._connection.timeout_s, attempts(reconnect, on_reconnect)
        )

    def preview(self, link: str, max_rate_hz: float = 0) -> PreviewStream:
        request = preview_pb2.StreamPreviewRequest(link=link, max_rate_hz=max_rate_hz)
        return PreviewStream(self._connection, request, self._connection.timeout_s)

    async def force_history(
        self, links: str | Iterable[str] = (), *, span_s: float = 60
    ) -> tuple[ForceHistory, ...]:
        return await self._connection.ask(_calls.force_history(links, span_s))

    async def caller(self) -> Caller:
        return await self._connection.ask(_calls.caller())

    # What operators do.

    async def tare(
        self,
        links: str | Iterable[str] = (),
        *,
        force: bool = False,
        frames: int = 10,
        undo: bool = False,
        timeout: float | None = None,
    ) -> tuple[LinkTare, ...]:
        return await self._connection.ask(_calls.tare(links, force, frames, undo, timeout))

    async def calibrate(
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
        request = _calls.calibrate_request(link, pairs, repeats, save, force)
        channel = self._connection.channel()
        call = channel.start("tactile", "Calibrate", request, chosen_s(timeout, SLOW_S * max(1, repeats)))
        try:
            async for message in call:
                if message.WhichOneof("message") == "result":
                    return calibration_from(message.result)
                if on_progress is not None:
                    on_progress(message.progress.pairs_taken, message.progress.pairs_wanted)
        except grpc.RpcError as error:
            raise self._connection.failure(error, channel) from error
        finally:
            call.cancel()
        raise errors.Internal("the server ended the calibration without a result")

    async def set_thresholds(
        self,
        link: str,
        *,
        warning_n: float = 0,
        alarm_n: float = 0,
        hysteresis_n: float = 0.05,
        region: str = "",
    ) -> ForceLevelState:
        return await self._connection.ask(_calls.set_thresholds(link, warning_n, alarm_n, hysteresis_n, region))

    async def set_force_model(self, link: str, model: str, *, timeout: float | None = None) -> None:
        await self._connection.ask(_calls.set_force_model(link, model, timeout))

    async def set_camera(
        self,
        link: str,
        camera: str = "",
        *,
        automatic_exposure: bool = False,
        exposure_s: float | None = None,
        gain: int | None = None,
        timeout: float | None = None,
    ) -> None:
        await self._connection.ask(
            _calls.set_camera(link, camera, automatic_exposure, exposure_s, gain, timeout)
        )

    async def restart_link(self, link: str) -> None:
        await self._connection.ask(_calls.restart_link(link))

    async def press(
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
        await self._connection.ask(
            _calls.press(link, angle_rad, z_m, depth_m, force_n, shape, diameter_m, body_id, hold_s)
        )

    async def release(self, link: str, body_id: int = 0) -> None:
        await self._connection.ask(_calls.release(link, body_id))

    async def set_scene_pressure(self, link: str, pressure_pa: float | None) -> None:
        await self._connection.ask(_calls.set_scene_pressure(link, pressure_pa))

    async def move_scene_joint(self, link: str, position_rad: float | None) -> None:
        await self._connection.ask(_calls.move_scene_joint(link, position_rad))

    async def set_pressure(
        self, link: str, pressure_pa: float, *, ramp_pa_per_s: float | None = None, reset_trip: bool = False
    ) -> Regulator:
        return await self._connection.ask(_calls.set_pressure(link, pressure_pa, ramp_pa_per_s, reset_trip))

    async def vent(self, link: str, *, reset_trip: bool = False) -> Regulator:
        return await self._connection.ask(_calls.vent(link, reset_trip))

    async def regulator(self, link: str) -> Regulator:
        return await self._connection.ask(_calls.regulator(link))

    def update_joint_states(self) -> JointStateWriter:
        return JointStateWriter(self._connection)

    def update_pressure(self) -> PressureWriter:
        return PressureWriter(self._connection)

    def update_attitude(self) -> AttitudeWriter:
        return AttitudeWriter(self._connection)

    # Recordings; they lie on the server.

    async def start_recording(
        self,
        name: str = "",
        *,
        links: str | Iterable[str] = (),
        pictures: bool = False,
        compression: str = "configured",
        note: str = "",
        timeout: float | None = None,
    ) -> RecorderStatus:
        return await self._connection.ask(
            _calls.start_recording(name, links, pictures, compression, note, timeout)
        )

    async def stop_recording(self, *, timeout: float | None = None) -> RecorderStatus:
        return await self._connection.ask(_calls.stop_recording(timeout))

    async def recorder(self) -> RecorderStatus:
        return await self._connection.ask(_calls.recorder())

    async def logs(self, *, timeout: float | None = None) -> tuple[Log, ...]:
        return await self._connection.ask(_calls.logs(timeout))

    async def describe_log(self, log: str, *, timeout: float | None = None) -> LogDescription:
        return await self._connection.ask(_calls.describe_log(log, timeout))

    async def download_log(
        self,
        log: str,
        path: FilePath,
        *,
        on_progress: Callable[[int, int], object] | None = None,
    ) -> Path:
        with Download(log, path) as download:
            channel = self._connection.channel()
            call = channel.start("recording", "DownloadLog", download.request())
            try:
                async for piece in call:
                    await asyncio.to_thread(download.take, piece)
                    if on_progress is not None:
                        on_progress(download.taken, download.size)
            except grpc.RpcError as error:
                raise download.explained(self._connection.failure(error, channel)) from error
            finally:
                call.cancel()
            return download.finish()

    async def delete_log(self, log: str) -> None:
        await self._connection.ask(_calls.delete_log(log))

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
        without = {"frames": not frames, "events": not events, "contacts": not contacts, "arm": not arm}
        request = _requests.replay(
            log, links, detail, from_utc_ns, to_utc_ns, speed, loop, paused, without
        )
        return Replay(self._connection, request, chosen_s(timeout, SLOW_S))
