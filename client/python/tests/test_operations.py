"""What operators do to links."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Iterator

import forces
import pytest
import server as servers

import taclink


def test_a_tare_is_accepted_or_refused_for_each_link(client: taclink.Client, touched: None) -> None:
    pressed, idle = client.tare(frames=3)
    assert (pressed.link, idle.link) == ("pressed", "idle")
    told = re.search(forces.IN_TEXT, pressed.reason)
    assert not pressed.accepted and "touched" in pressed.reason and told and float(told[1]) == forces.PRESS_N
    assert idle.accepted and idle.reason == "" and idle.frames == 3 and not idle.forced
    assert 0 <= idle.shift_m < 1e-3 and idle.previous_age_s > 0
    servers.until(lambda: client.arm().link("idle").baseline.origin == "tare", "the baseline is new")
    (only,) = client.tare("idle", frames=1)
    assert only.accepted
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        client.tare(["idle", "none"])
    with pytest.raises(taclink.InvalidArgument, match="300"):
        client.tare(frames=301)


def test_a_calibration_tells_its_progress_and_result(client: taclink.Client, measuring: None) -> None:
    told: list[tuple[int, int]] = []
    result = client.calibrate("idle", pairs=5, on_progress=lambda taken, wanted: told.append((taken, wanted)))
    assert told and told == sorted(told) and all(0 < taken <= wanted == 5 for taken, wanted in told)
    assert result.markers_used > 100 and 0 < result.rms_px < 1
    assert max(result.rmse_r_m, result.rmse_tangential_m, result.rmse_z_m) < 1e-3
    assert result.file_text.startswith("taclink_calibration:") and result.saved_to == ""
    assert [one.name for one in result.parameters[:3]] == ["position_x", "position_y", "position_z"]
    assert result.repeats == 1 and result.parameters[0].mean is None
    servers.until(lambda: client.arm().link("idle").baseline.origin == "calibration", "the baseline is new")


def test_a_calibration_is_refused_or_cancelled(client: taclink.Client, touched: None, measuring: None) -> None:
    with pytest.raises(taclink.Refused, match="touched; let go of it"):
        client.calibrate("pressed")
    with pytest.raises(taclink.Refused, match="calibration"):
        client.calibrate("idle", save=True)
    with pytest.raises(taclink.InvalidArgument, match="300"):
        client.calibrate("idle", pairs=301)
    before = client.arm().link("idle").baseline.taken_utc_ns

    def stop(taken: int, wanted: int) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        client.calibrate("idle", pairs=300, on_progress=stop)
    servers.until(lambda: client.arm().link("idle").status == "ok", "the link measures again")
    assert client.arm().link("idle").baseline.taken_utc_ns == before


def test_thresholds_are_set_and_told(client: taclink.Client, touched: None) -> None:
    with client.events("pressed", ["thresholds", "force_level"]) as events:
        state = client.set_thresholds("pressed", warning_n=0.05, alarm_n=0.1, hysteresis_n=0.01)
        assert state.thresholds == taclink.Thresholds(warning_n=0.05, alarm_n=0.1, hysteresis_n=0.01)
        assert state.region == "" and state.markers is None
        first, second = next(events), next(events)
    assert isinstance(first.detail, taclink.OperationEvent) and first.detail.accepted
    assert first.detail.values["warning_n"] == 0.05 and first.detail.who
    assert isinstance(second.detail, taclink.ForceLevelEvent) and second.detail.level == "alarm"
    servers.until(lambda: client.arm().link("pressed").force_levels[0].level == "alarm", "the level is told")
    assert client.set_thresholds("pressed", region="near", warning_n=1).region == "near"
    client.set_thresholds("pressed", region="near", warning_n=0.1)
    with pytest.raises(taclink.NotFound, match="no region 'far'; it has near"):
        client.set_thresholds("pressed", region="far")
    with pytest.raises(taclink.InvalidArgument):
        client.set_thresholds("pressed", warning_n=2, alarm_n=1)


def test_a_force_model_is_used_from_the_next_frame_on(client: taclink.Client, measuring: None) -> None:
    client.set_force_model("idle", "nonlinear")
    with client.frames("idle", every=True) as frames:
        measured = (frame for frame in frames if frame.times.exposure_utc_ns)
        # The last one before and the one in work may still come with the old model.
        models = [next(measured).force_model for _ in range(4)]
    assert models[-1] == "nonlinear"
    client.set_force_model("idle", taclink.ForceModel.AUTO)
    client.set_force_model("idle", taclink.ForceModel.LINEAR)
    with pytest.raises(taclink.InvalidArgument, match="linear, literal"):
        client.set_force_model("idle", "best")
    with pytest.raises(taclink.NotFound):
        client.set_force_model("none", "linear")


def test_cameras_take_settings(client: taclink.Client, measuring: None) -> None:
    with client.events("idle", "camera") as events:
        client.set_camera("idle", "top", exposure_s=2.5e-3, gain=2)  # as bright as before
        detail = next(events).detail
        assert isinstance(detail, taclink.OperationEvent) and detail.accepted
        assert detail.values["exposure_s"] == pytest.approx(2.5e-3) and detail.values["gain"] == 2
    client.set_camera("idle", exposure_s=5e-3, gain=1)
    with pytest.raises(taclink.Unsupported, match="no automatic exposure"):
        client.set_camera("idle", automatic_exposure=True)
    with pytest.raises(taclink.InvalidArgument, match="top"):
        client.set_camera("idle", "left", gain=1)
    with pytest.raises(taclink.InvalidArgument, match="exposure must be 0.1 to 100 ms"):
        client.set_camera("idle", exposure_s=1)
    with pytest.raises(taclink.InvalidArgument):
        client.set_camera("idle")
    with pytest.raises(taclink.InvalidArgument, match="either"):
        client.set_camera("idle", automatic_exposure=True, exposure_s=1e-3)


@pytest.fixture
def alone(tmp_path: Path) -> Iterator[servers.Server]:
    """Of one link that may be restarted, whose pressure clients tell."""
    config = servers.HEAD + servers.links(
        servers.link("skin", "rest", ", pressure: {source: grpc, stale_after_s: 3600}")
    )
    running = servers.Server(tmp_path, config)
    yield running
    running.stop()


def test_pressures_are_told_and_links_restarted(alone: servers.Server) -> None:
    with taclink.Client(alone.address, timeout=servers.PATIENCE_S) as client:
        assert "no reading yet" in servers.until(lambda: client.arm().links[0].status_reason, "it waits for a reading")
        with client.update_pressure() as writer:
            writer.write(0.0, link="skin")
            writer.write(0.0)
        assert writer.summary == taclink.PressureSummary(accepted=2, refused=0)
        servers.until(lambda: client.arm().links[0].status == "ok", "the link measures")
        frame = next(frame for frame in client.frames() if frame.pressure is not None)
        assert frame.pressure is not None and frame.pressure.origin == "client"
        assert frame.pressure_pa == frame.pressure.pressure_pa == 0.0
        assert frame.pressure.age_s is not None and not frame.pressure.assumed

        before = client.arm().links[0]
        client.restart_link("skin")
        servers.until(
            lambda: client.arm().links[0].statistics.worker_restarts > before.statistics.worker_restarts, "a new worker"
        )
        servers.until(lambda: client.arm().links[0].status == "ok", "the link measures again")
        with pytest.raises(taclink.NotFound, match="there|has skin"):
            client.restart_link("none")


def test_attitudes_are_refused_with_the_reason(client: taclink.Client) -> None:
    writer = client.update_attitude()
    writer.write((0.0, 0.0, -9.81), link="idle")
    with pytest.raises(taclink.Refused, match="gravity: {source: grpc}"):
        writer.finish()
    with pytest.raises(taclink.InvalidArgument, match="3 components, not 2"):
        client.update_attitude().write((0.0, -9.81), link="idle")


def test_pressures_are_refused_with_the_reason(client: taclink.Client) -> None:
    writer = client.update_pressure()
    writer.write(100.0, link="idle")
    with pytest.raises(taclink.Refused, match="pressure: {source: grpc}"):
        writer.finish()
    with pytest.raises(taclink.Refused, match="source: grpc"):  # once more: it stays so
        writer.write(100.0)
    writer = client.update_pressure()
    writer.write(100.0, link="none")
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        writer.finish()
    with pytest.raises(ZeroDivisionError):
        with client.update_pressure():
            raise ZeroDivisionError


def test_a_simulated_skin_is_pressed_and_released(client: taclink.Client, measuring: None) -> None:
    with pytest.raises(taclink.InvalidArgument, match="depth or a force"):
        client.press("idle", 0, 0.08)
    with pytest.raises(taclink.InvalidArgument, match="between the clamped ends"):
        client.press("idle", 0, 8, depth_m=0.005)
    with pytest.raises(taclink.InvalidArgument, match="shape must be one of finger"):
        client.press("idle", 0, 0.08, depth_m=0.005, shape="foot")

    def pressing(frame: taclink.Frame) -> list[taclink.AppliedContact]:
        assert frame.simulation is not None and frame.simulation.trouble == ""
        return [each for each in frame.simulation.contacts if each.body_id == 3]

    client.press("idle", 0.7, 0.08, depth_m=0.006, body_id=3)
    deep = next(frame for frame in client.frames("idle") if any(each.depth_m > 0.0055 for each in pressing(frame)))
    (body,) = pressing(deep)
    assert body.force_n.shape == body.center_m.shape == (3,) and body.force_n @ body.normal < 0
    client.set_scene_pressure("idle", None)
    client.release("idle", 3)
    with pytest.raises(taclink.NotFound, match="no body 3"):
        client.release("idle", 3)
    assert any(not pressing(frame) for frame in client.frames("idle"))
