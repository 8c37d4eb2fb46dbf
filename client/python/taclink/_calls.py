"""What is asked of a server with one answer, for both kinds of client."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from taclink._patience import SLOW_S, chosen_s
from taclink.errors import InvalidArgument
from taclink.messages.arm import Arm, arm_from
from taclink.messages.baseline import LinkTare, tares_from
from taclink.messages.force_level import ForceLevelState, force_level_state_from
from taclink.messages.history import ForceHistory, histories_from
from taclink.messages.others import Caller, ReplayPictures, caller_from, replay_pictures_from
from taclink.messages.recording import (
    Log,
    LogDescription,
    RecorderStatus,
    description_from,
    logs_from,
    recorder_from,
)
from taclink.messages.pressure import Regulator, regulator_from
from taclink.names import BodyShape, ForceModel, LogCompression, number_of
from taclink.v1 import (
    events_pb2,
    history_pb2,
    operations_pb2,
    pressure_pb2,
    recording_pb2,
    simulation_pb2,
    tactile_pb2,
    tare_pb2,
)

T = TypeVar("T")


@dataclass(frozen=True)
class Call(Generic[T]):
    """`method` of `service` (tactile, operations, pressure, recording or simulation), and what its answer means."""

    service: str
    method: str
    request: Any
    result: Callable[[Any], T]
    timeout_s: float | None = None  # None: the client's


def names(links: str | Iterable[str]) -> list[str]:
    """One name, or several; none: all links."""
    return [links] if isinstance(links, str) else list(links)


def _nothing(_: Any) -> None:
    return None


def arm() -> Call[Arm]:
    return Call("tactile", "GetArm", tactile_pb2.GetArmRequest(), lambda answer: arm_from(answer.arm))


def force_history(links: str | Iterable[str], span_s: float) -> Call[tuple[ForceHistory, ...]]:
    request = history_pb2.GetForceHistoryRequest(links=names(links), span_s=span_s)
    return Call("tactile", "GetForceHistory", request, histories_from)


def caller() -> Call[Caller]:
    return Call("operations", "GetCaller", operations_pb2.GetCallerRequest(), caller_from)


def restart_link(link: str) -> Call[None]:
    return Call("operations", "RestartLink", operations_pb2.RestartLinkRequest(link=link), _nothing)


def press(
    link: str,
    angle_rad: float,
    z_m: float,
    depth_m: float | None,
    force_n: float | None,
    shape: str,
    diameter_m: float,
    body_id: int,
    hold_s: float,
) -> Call[None]:
    if (depth_m is None) == (force_n is None):
        raise InvalidArgument("a body needs a depth or a force, and not both")
    request = simulation_pb2.PressRequest(
        link=link,
        body_id=body_id,
        shape=number_of(BodyShape, shape, "shape"),
        diameter_m=diameter_m,
        angle_rad=angle_rad,
        z_m=z_m,
        depth_m=depth_m,
        force_n=force_n,
        hold_s=hold_s,
    )
    return Call("simulation", "Press", request, _nothing)


def release(link: str, body_id: int) -> Call[None]:
    request = simulation_pb2.ReleaseRequest(link=link, body_id=body_id)
    return Call("simulation", "Release", request, _nothing)


def set_scene_pressure(link: str, pressure_pa: float | None) -> Call[None]:
    request = simulation_pb2.SetScenePressureRequest(link=link, pressure_pa=pressure_pa)
    return Call("simulation", "SetScenePressure", request, _nothing)


def move_scene_joint(link: str, position_rad: float | None) -> Call[None]:
    request = simulation_pb2.MoveSceneJointRequest(link=link, position_rad=position_rad)
    return Call("simulation", "MoveSceneJoint", request, _nothing)


def _regulator_of(answer: Any) -> Regulator:
    return regulator_from(answer.regulator)


def set_pressure(link: str, pressure_pa: float, ramp_pa_per_s: float | None, reset_trip: bool) -> Call[Regulator]:
    request = pressure_pb2.SetPressureRequest(
        link=link, pressure_pa=pressure_pa, ramp_pa_per_s=ramp_pa_per_s, reset_trip=reset_trip
    )
    return Call("pressure", "SetPressure", request, _regulator_of)


def vent(link: str, reset_trip: bool) -> Call[Regulator]:
    request = pressure_pb2.SetPressureRequest(link=link, vent=True, reset_trip=reset_trip)
    return Call("pressure", "SetPressure", request, _regulator_of)


def regulator(link: str) -> Call[Regulator]:
    return Call("pressure", "GetPressure", pressure_pb2.GetPressureRequest(link=link), _regulator_of)


def tare(
    links: str | Iterable[str], force: bool, frames: int, undo: bool, timeout: float | None
) -> Call[tuple[LinkTare, ...]]:
    request = tare_pb2.TareRequest(links=names(links), force=force, frames=frames, undo=undo)
    return Call("tactile", "Tare", request, tares_from, chosen_s(timeout, SLOW_S))


def set_thresholds(
    link: str, warning_n: float, alarm_n: float, hysteresis_n: float, region: str
) -> Call[ForceLevelState]:
    request = events_pb2.SetThresholdsRequest(
        link=link,
        region=region,
        thresholds=events_pb2.Thresholds(warning_n=warning_n, alarm_n=alarm_n, hysteresis_n=hysteresis_n),
    )
    return Call(
        "tactile", "SetThresholds", request, lambda answer: force_level_state_from(answer.state)
    )


def set_force_model(link: str, model: str, timeout: float | None) -> Call[None]:
    number = number_of(ForceModel, model, "model")
    request = tactile_pb2.SetForceModelRequest(link=link, model=number)
    return Call("tactile", "SetForceModel", request, _nothing, chosen_s(timeout, SLOW_S))


def set_camera(
    link: str,
    camera: str,
    automatic_exposure: bool,
    exposure_s: float | None,
    gain: int | None,
    timeout: float | None,
) -> Call[None]:
    if automatic_exposure and exposure_s is not None:
        raise InvalidArgument("either the camera decides on the exposure, or exposure_s says it")
    request = tactile_pb2.SetCameraRequest(link=link, camera=camera, exposure_s=exposure_s, gain=gain)
    if automatic_exposure:
        request.automatic = True
    return Call("tactile", "SetCamera", request, _nothing, chosen_s(timeout, SLOW_S))


def calibrate_request(
    link: str, pairs: int, repeats: int, save: bool, force: bool
) -> tactile_pb2.CalibrateRequest:
    return tactile_pb2.CalibrateRequest(link=link, pairs=pairs, repeats=repeats, save=save, force=force)


def start_recording(
    name: str, links: str | Iterable[str], pictures: bool, compression: str, note: str, timeout: float | None
) -> Call[RecorderStatus]:
    request = recording_pb2.StartRecordingRequest(
        name=name,
        links=names(links),
        pictures=pictures,
        compression=number_of(LogCompression, compression, "compression"),
        note=note,
    )
    return Call("recording", "StartRecording", request, _status_of, chosen_s(timeout, SLOW_S))


def _status_of(answer: Any) -> RecorderStatus:
    return recorder_from(answer.status)


def stop_recording(timeout: float | None) -> Call[RecorderStatus]:
    request = recording_pb2.StopRecordingRequest()
    return Call("recording", "StopRecording", request, _status_of, chosen_s(timeout, SLOW_S))


def recorder() -> Call[RecorderStatus]:
    return Call("recording", "GetRecorder", recording_pb2.GetRecorderRequest(), _status_of)


def logs(timeout: float | None) -> Call[tuple[Log, ...]]:
    return Call("recording", "ListLogs", recording_pb2.ListLogsRequest(), logs_from, chosen_s(timeout, SLOW_S))


def describe_log(log: str, timeout: float | None) -> Call[LogDescription]:
    request = recording_pb2.DescribeLogRequest(log=log)
    return Call("recording", "DescribeLog", request, description_from, chosen_s(timeout, SLOW_S))


def delete_log(log: str) -> Call[None]:
    return Call("recording", "DeleteLog", recording_pb2.DeleteLogRequest(log=log), _nothing)


def control_replay(player: str, **action: Any) -> Call[None]:
    """`action`: one field of ControlReplayRequest.action."""
    request = recording_pb2.ControlReplayRequest(player=player, **action)
    return Call("recording", "ControlReplay", request, _nothing)


def replay_pictures(player: str, link: str, utc_ns: int) -> Call[ReplayPictures]:
    request = recording_pb2.GetReplayPicturesRequest(player=player, link=link, utc_ns=utc_ns)
    return Call("recording", "GetReplayPictures", request, replay_pictures_from)
