"""What a running arm tells: shapes, units and sums."""

from __future__ import annotations

import json
import re
import subprocess
import threading
from typing import Any

import numpy as np
import pytest
import server as servers

import taclink


def command(server: servers.Server, *arguments: str) -> Any:
    """The last line of JSON of the `taclink` command."""
    done = subprocess.run(
        [str(servers.TACLINK), *arguments, "--server", server.address, "--json"],
        check=True,
        capture_output=True,
        timeout=servers.PATIENCE_S,
    )
    return json.loads(done.stdout.splitlines()[-1])


def test_the_arm_is_as_the_command_lists_it(server: servers.Server, client: taclink.Client, measuring: None) -> None:
    listed = command(server, "list")
    arm = client.arm()
    assert (arm.name, arm.server_version) == (listed["arm"], listed["server_version"])
    assert arm.server_version == taclink.__version__
    assert [link.name for link in arm.links] == [link["link"] for link in listed["links"]] == ["pressed", "idle"]
    for link, there in zip(arm.links, listed["links"]):
        assert link.status == there["state"] == "ok" and link.status_reason == ""
        assert link.model.name == there["model"] and link.source.kind == there["source"] == "simulated"
        assert link.supervision == there["supervision"] == "running"
        assert link.statistics.frames >= there["frames"] > 0
        assert link.statistics.latency_p99_s >= link.statistics.latency_p50_s > 0
        assert link.baseline.origin != "none" and link.baseline.taken_utc_ns > 0
    assert arm.link("idle").index == 1
    with pytest.raises(KeyError, match="there are: pressed, idle"):
        arm.link("none")
    assert arm.joints == () and arm.base_frame == ""
    near = arm.links[0].force_levels[1]
    assert near.region == "near" and near.markers == taclink.MarkerRange(
        first_ring=3, last_ring=5, first_path=4, last_path=8
    )
    assert near.thresholds.warning_n == 0.1


def test_markers_lie_ring_by_ring_on_the_model(client: taclink.Client) -> None:
    model = client.arm().links[0].model
    text = subprocess.run([str(servers.TACLINK), "show", "model", "cylinder"], check=True, capture_output=True).stdout
    for field, value_m in (("length_mm", model.length_m), ("thickness_mm", model.thickness_m)):
        value_mm = re.search(rf"^  {field}: ([0-9.]+)$", text.decode(), re.MULTILINE)
        assert value_mm and value_m == pytest.approx(float(value_mm[1]) * 1e-3)
    assert model.rest_positions_m.shape == (model.markers, 3) == (240, 3)
    assert model.ring_z_m.shape == (model.rings,)
    ring, path = np.divmod(np.arange(model.markers), model.paths)
    x, y, z = model.rest_positions_m.T
    assert z == pytest.approx(model.ring_z_m[ring], abs=1e-6)
    angles = model.first_path_angle_rad + path * 2 * np.pi / model.paths
    assert np.cos(np.arctan2(y, x) - angles) == pytest.approx(1)
    depth_m = np.interp(z, model.profile_z_m, model.profile_radius_m) - np.hypot(x, y)
    assert (depth_m >= model.thickness_m).all(), "on the inner wall"
    assert (depth_m <= model.thickness_m + model.marker_diameter_m).all()
    assert 1e3 < model.youngs_modulus_pa < 1e7 and 0 <= model.poisson_ratio <= 0.5


def test_forces_of_a_full_frame_add_up(client: taclink.Client, touched: None) -> None:
    model = client.arm().links[0].model
    frame = next(client.frames("pressed", "full"))
    assert frame.detail == "full" and frame.force_model == "nonlinear" and frame.force_converged
    for rows in (frame.positions_m, frame.displacements_m, frame.nodal_forces_n):
        assert rows.shape == (240, 3) and rows.dtype == np.float64 and not rows.flags.writeable
    assert frame.displacement_covariances_m2.shape == (240, 3, 3)
    assert (np.linalg.eigvalsh(frame.displacement_covariances_m2) > -1e-12).all()
    assert frame.nodal_force_sigmas_n.shape == frame.marker_sources.shape == (240,)
    seen = np.isin(
        frame.marker_sources, [taclink.MarkerSource.BOTH, taclink.MarkerSource.TOP, taclink.MarkerSource.BOTTOM]
    )
    assert frame.markers_seen == seen.sum() and frame.markers_seen + frame.markers_inferred == 240
    # The skin lies where it rested, but for its displacement and what the cameras err by.
    rest_m = frame.positions_m - frame.displacements_m
    assert np.linalg.norm(rest_m - model.rest_positions_m, axis=1).max() < 1e-3
    contact = frame.contacts[0]
    assert frame.nodal_forces_n.sum(axis=0) == pytest.approx(frame.total_force_n, abs=1e-5)
    assert contact.force_n == pytest.approx(frame.total_force_n, abs=1e-9)
    # 0.2 N against the normal at marker (7, 5).
    assert contact.normal_force_n == pytest.approx(0.2, rel=0.1)
    # The resultant is a little less than the integral of the normal load: the normal turns over the contact.
    assert contact.force_n @ contact.normal == pytest.approx(-contact.normal_force_n, rel=0.02)
    assert 4 * 24 + 6 in contact.markers
    assert np.linalg.norm(contact.center_m - frame.positions_m[4 * 24 + 6]) < 5e-3
    assert contact.force_covariance_n2 is not None and contact.force_covariance_n2.shape == (3, 3)
    assert contact.center_covariance_m2 is not None and contact.center_covariance_m2.shape == (3, 3)
    assert np.linalg.norm(frame.displacements_m[contact.markers], axis=1).max() > 1e-3


def test_each_level_of_detail_holds_what_it_says(client: taclink.Client, measuring: None) -> None:
    frames = {detail: next(client.frames("idle", detail)) for detail in ("contacts", "geometry", "full")}
    rows = {detail: (len(f.positions_m), len(f.nodal_forces_n)) for detail, f in frames.items()}
    assert rows == {"contacts": (0, 0), "geometry": (240, 0), "full": (240, 240)}
    for detail, frame in frames.items():
        assert frame.detail == detail and frame.link == "idle" and frame.link_index == 1
        assert frame.contacts == () and not frame.replayed and not frame.unchanged
        assert frame.pressure is not None and frame.pressure.origin == "simulated"
        times = frame.times
        assert times.exposure_ns < times.received_ns <= times.tracked_ns <= times.solved_ns <= times.published_ns
        assert frame.latency_s is not None and frame.latency_s > 0
        assert times.client_utc_ns - times.exposure_utc_ns >= times.published_ns - times.exposure_ns
        assert len(frame.cameras) == 2 and frame.baseline.origin != "none" and frame.baseline_age_s > 0


def test_geometry_is_what_the_command_shows(server: servers.Server, client: taclink.Client, touched: None) -> None:
    shown = command(server, "watch", "--links", "pressed", "--detail", "geometry", "--count", "1", "--patience", "60")
    frame = next(client.frames("pressed", "geometry"))
    assert frame.positions_m * 1e3 == pytest.approx(np.array(shown["positions_mm"]), abs=1)
    assert shown["link"] == frame.link and shown["status"] == frame.status


def test_contacts_in_the_base_frame(server: servers.Server, client: taclink.Client, touched: None) -> None:
    pose = client.arm().links[0].base_from_link
    arm = next(client.contacts())
    own = next(client.frames("pressed")).contacts[0]
    assert pose.rotation @ pose.rotation.T == pytest.approx(np.eye(3))
    assert pose.translation_m == pytest.approx([0.01, 0.02, 0.03])
    assert pose.matrix @ [0, 0, 0.1, 1] == pytest.approx([*pose.of_points(np.array([0, 0, 0.1])), 1])
    (contact,) = arm.contacts
    assert (contact.link, contact.link_contact_id) == ("pressed", own.id)
    assert contact.id == (contact.link_index << 40) + own.id
    assert contact.center_m == pytest.approx(pose.of_points(own.center_m), abs=2e-3)
    assert contact.force_n == pytest.approx(pose.of_directions(own.force_n), abs=0.02)
    assert contact.moment_nm == pytest.approx(np.cross(contact.center_m, contact.force_n))
    assert arm.total_force_n == pytest.approx(contact.force_n)
    assert arm.total_moment_nm == pytest.approx(contact.moment_nm)
    assert contact.validity == arm.validity == "fixed" and arm.joints == ()
    assert [link.link for link in arm.links] == ["pressed", "idle"]
    assert arm.links[0].base_from_link.translation_m == pytest.approx(pose.translation_m)
    shown = command(server, "contacts", "--count", "1")["contacts"][0]
    assert contact.center_m * 1e3 == pytest.approx(shown["center_mm"], abs=2)
    assert contact.force_n == pytest.approx(shown["force_n"], abs=0.02)
    assert 0.1 < contact.area_m2 * 1e6 / shown["area_mm2"] < 10  # the same unit: it is of whole markers, and jumps


def test_every_frame_comes_in_order_and_rates_leave_gaps(client: taclink.Client, measuring: None) -> None:
    with client.frames(every=True) as frames:
        assert [counts.link for counts in frames.counts] == ["pressed", "idle"] and frames.queue_capacity > 0
        last: dict[str, int] = {}
        for frame in (next(frames) for _ in range(12)):
            missing = None if frame.link not in last else max(frame.sequence - last[frame.link] - 1, 0)
            assert frame.gap == missing
            last[frame.link] = frame.sequence
        assert set(last) == {"pressed", "idle"}
    with client.frames(["idle"], max_rate_hz=4) as slow:
        assert any((frame.gap or 0) > 0 for frame in (next(slow) for _ in range(4)))


def test_a_still_link_within_the_deadband_shows_a_sign_of_life(client: taclink.Client, touched: None) -> None:
    with client.frames("pressed", "full", deadband_force_n=5, deadband_move_m=0.05) as frames:
        first, second = next(frames), next(frames)
        assert not first.unchanged and len(first.positions_m) == 240
        assert second.unchanged and second.detail == "contacts" and len(second.contacts) == 1


def test_events_are_numbered_and_resumed(client: taclink.Client, touched: None) -> None:
    with client.events(after=taclink.EventPlace()) as events:
        found: list[taclink.Event] = []
        while not any(event.kind == "contact_begin" for event in found):
            found.append(next(events))
        place = events.place
        assert place is not None and place.after_sequence == found[-1].sequence
        assert events.newest_sequence >= found[-1].sequence and events.events_lost == 0 and not events.run_changed
    assert [event.sequence for event in found] == list(range(1, len(found) + 1))
    begin = found[-1]
    assert isinstance(begin.detail, taclink.ContactEvent) and begin.link == "pressed"
    assert begin.detail.end_reason == "" and begin.detail.force_n.shape == (3,)
    assert begin.latency_s is not None and begin.latency_s > 0
    statuses = [event.detail for event in found if event.kind == "link_status"]
    assert statuses and all(isinstance(status, taclink.LinkStatusEvent) for status in statuses)
    middle = taclink.EventPlace(run_id=place.run_id, after_sequence=2)
    with client.events(kinds=["contact_begin", "baseline"], after=middle) as events:
        kinds = {next(events).kind for _ in range(3)}
    assert kinds == {taclink.EventKind.CONTACT_BEGIN, taclink.EventKind.BASELINE}
    with client.events("pressed", after=middle) as events:
        assert next(events).sequence > 2


def test_force_levels_are_events(client: taclink.Client, touched: None) -> None:
    with client.events("pressed", "force_level", after=taclink.EventPlace()) as events:
        crossed = next(events).detail
    assert isinstance(crossed, taclink.ForceLevelEvent) and crossed.region == "near"
    assert (crossed.previous, crossed.level) == ("normal", "warning") and crossed.force_n > 0.1


def test_previews_are_pictures_with_their_markers(client: taclink.Client, measuring: None) -> None:
    with client.preview("idle", max_rate_hz=30) as previews:
        preview = next(previews)
    assert preview.link == "idle" and preview.sequence > 0 and preview.exposure_utc_ns > 0
    assert [picture.camera for picture in preview.pictures] == ["top", "bottom"]
    for picture in preview.pictures:
        assert picture.jpeg.startswith(b"\xff\xd8") and picture.why_missing == ""
        assert len(picture.markers) > 100
        assert picture.centers_px.shape == (len(picture.markers), 2)
        assert picture.center_sigmas_px.shape == (len(picture.markers),)
        assert (picture.centers_px > 0).all() and (picture.centers_px < [picture.width_px, picture.height_px]).all()


def test_refusals_come_at_the_call_and_say_what_to_do(client: taclink.Client) -> None:
    with pytest.raises(taclink.NotFound, match="no link 'none'; this arm has pressed, idle") as refused:
        client.frames("none")
    assert refused.value.address == client.address and refused.value.details == str(refused.value)
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        client.events("none")
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        next(client.preview("none"))
    with pytest.raises(taclink.InvalidArgument, match="max_rate_hz must be"):
        client.frames(max_rate_hz=-1)
    with pytest.raises(taclink.InvalidArgument, match="max_rate_hz must be"):
        client.contacts(float("nan"))
    with pytest.raises(taclink.InvalidArgument, match="contacts, geometry, full, not 'all'"):
        client.frames(detail="all")
    with pytest.raises(taclink.InvalidArgument, match="kind must be one of contact_begin, .*, not 'touch'"):
        client.events(kinds=["touch"])


def test_a_loop_that_is_left_leaves_no_stream(server: servers.Server, client: taclink.Client) -> None:
    servers.until(lambda: server.open_streams() == 0, "no stream is left of tests before")
    for _ in client.frames():
        assert server.open_streams() == 1
        break
    servers.until(lambda: server.open_streams() == 0, "the frames' stream has ended")
    held = client.contacts()
    with held:
        next(held)
        assert server.open_streams() == 1
    servers.until(lambda: server.open_streams() == 0, "the contacts' stream has ended")
    assert list(held) == []
    with taclink.Client(server.address, timeout=servers.PATIENCE_S) as other:
        frames = other.frames()
        next(frames)
    assert list(frames) == []  # the client was closed
    servers.until(lambda: server.open_streams() == 0, "the closed client's stream has ended")
    with pytest.raises(taclink.Cancelled, match="closed"):
        other.arm()


def test_close_ends_an_iteration_that_waits(client: taclink.Client) -> None:
    events = client.events(kinds="camera")
    closer = threading.Thread(target=events.close)
    closer.start()
    assert list(events) == []
    closer.join()


def test_proxies_are_passed_by(server: servers.Server, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("http_proxy", "https_proxy", "grpc_proxy"):
        monkeypatch.setenv(variable, "http://127.0.0.1:1")
    with taclink.Client(server.address, timeout=servers.PATIENCE_S) as client:
        assert client.arm().name == "test"


def test_who_calls(client: taclink.Client) -> None:
    caller = client.caller()
    assert (caller.name, caller.role, caller.tokens) == ("", taclink.Role.OPERATOR, False)


def test_the_history_has_what_came_before(server: servers.Server, touched: None, client: taclink.Client) -> None:
    newest = next(iter(client.frames("pressed")))
    pressed, idle = client.force_history(span_s=30)
    assert (pressed.link, idle.link) == ("pressed", "idle")
    assert len(pressed.exposure_utc_ns) == len(pressed.total_magnitude_n) > 0
    assert np.all(np.diff(pressed.exposure_utc_ns) > 0)
    assert pressed.exposure_utc_ns[-1] >= newest.times.exposure_utc_ns - 10**9
    assert np.nanmax(pressed.total_magnitude_n) > 0.05
    contact = pressed.contacts[-1]
    assert contact.samples[-1] < len(pressed.exposure_utc_ns) and np.all(np.diff(contact.samples) > 0)
    strongest_n = max(np.max(each.magnitude_n) for each in pressed.contacts)
    assert strongest_n == pytest.approx(np.nanmax(pressed.total_magnitude_n), rel=0.2)
    (only,) = client.force_history("idle")
    assert only.link == "idle"
    with pytest.raises(taclink.NotFound):
        client.force_history("elbow")
