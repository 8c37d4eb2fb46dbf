"""Recordings on the server, their download and their replay."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Iterator

import numpy as np
import pytest
import server as servers

import taclink


@dataclass
class Recorded:
    name: str
    status: taclink.RecorderStatus
    live: dict[tuple[str, int], taclink.Frame]  # all that was streamed meanwhile


@pytest.fixture(scope="module")
def recorded(server: servers.Server) -> Iterator[Recorded]:
    """Some frames of both links, with pictures."""
    with taclink.Client(server.address, timeout=servers.PATIENCE_S) as client:
        servers.until(lambda: all(link.status == "ok" for link in client.arm().links), "both links measure")
        live: dict[tuple[str, int], taclink.Frame] = {}
        frames = client.frames(detail="full", every=True)

        def collect() -> None:
            for frame in frames:
                if frame.times.exposure_utc_ns:
                    live[frame.link, frame.sequence] = frame

        def wait_for_more() -> None:
            so_far = len(live)
            servers.until(lambda: len(live) >= so_far + 8, "more frames come")

        collector = threading.Thread(target=collect, daemon=True)
        collector.start()
        wait_for_more()
        started = client.start_recording("trial", pictures=True, compression="zstd", note="of a test")
        assert started.state == "recording" and started.pictures and started.log.startswith("trial")
        servers.until(lambda: client.recorder().frames >= 30, "frames are recorded")
        status = client.stop_recording()
        wait_for_more()
        frames.close()
        collector.join()
    assert status.state == "idle" and status.frames > 0 and status.frames_lost == 0
    yield Recorded(status.log, status, live)


def test_the_log_is_listed_and_described(client: taclink.Client, recorded: Recorded) -> None:
    assert client.recorder().log == recorded.name
    (log,) = [log for log in client.logs() if log.name == recorded.name]
    assert log.links == ("pressed", "idle") or set(log.links) == {"pressed", "idle"}
    assert log.frames == recorded.status.frames and log.note == "of a test" and log.pictures
    assert not log.open and log.problem == "" and 0 < log.start_utc_ns < log.end_utc_ns
    described = client.describe_log(recorded.name)
    assert described.log.name == recorded.name and described.losses == ()
    assert [link.name for link in described.arm.links] == ["pressed", "idle"]
    topics = {channel.topic: channel for channel in described.channels}
    assert topics["/links/idle/frame"].schema == "taclink.v1.LinkFrame" and topics["/links/idle/frame"].messages > 0
    assert "taclinkd.yaml" in {attachment.name for attachment in described.attachments}
    assert described.metadata["taclink.arm"] == "test"


def test_a_replay_gives_what_was_streamed(client: taclink.Client, recorded: Recorded) -> None:
    with client.replay(recorded.name, speed=0) as replay:
        assert replay.status is not None and not replay.status.ended
        messages = list(replay)
    assert isinstance(messages[0].content, taclink.ReplayStatus)
    last = messages[-1].content
    assert isinstance(last, taclink.ReplayStatus) and last.ended and last.damaged == 0 and replay.status is last
    kinds = {type(message.content) for message in messages}
    assert {taclink.Frame, taclink.ArmContacts, taclink.Arm} <= kinds
    times = [message.log_utc_ns for message in messages if not isinstance(message.content, taclink.ReplayStatus)]
    assert times == sorted(times)
    for link in ("pressed", "idle"):
        played = {
            message.content.sequence: message.content
            for message in messages
            if isinstance(message.content, taclink.Frame)
            and message.content.link == link
            and message.content.times.exposure_utc_ns
        }
        streamed = {sequence for name, sequence in recorded.live if name == link}
        assert len(played) > 5
        assert sorted(played) == sorted(s for s in streamed if min(played) <= s <= max(played))
        for sequence, frame in played.items():
            assert frame.replayed and frame.latency_s is None and frame.gap is None
            then = recorded.live[link, sequence]
            assert frame.times.exposure_utc_ns == then.times.exposure_utc_ns
            assert np.array_equal(frame.positions_m, then.positions_m)
            assert np.array_equal(frame.nodal_forces_n, then.nodal_forces_n)


def test_a_replay_plays_what_was_asked_for(client: taclink.Client, recorded: Recorded) -> None:
    (log,) = [log for log in client.logs() if log.name == recorded.name]
    middle_ns = (log.start_utc_ns + log.end_utc_ns) // 2
    with client.replay(
        recorded.name,
        links="idle",
        detail="contacts",
        from_utc_ns=middle_ns,
        speed=0,
        events=False,
        contacts=False,
        arm=False,
    ) as replay:
        for message in replay:
            assert isinstance(message.content, (taclink.Frame, taclink.ReplayStatus))
            if isinstance(message.content, taclink.Frame):
                assert message.content.link == "idle" and message.content.positions_m.shape == (0, 3)
                assert message.log_utc_ns >= middle_ns
    with client.replay(recorded.name, speed=0, frames=False) as replay:
        assert not any(isinstance(message.content, taclink.Frame) for message in replay)


def frames_of(replay: taclink.Replay, count: int) -> list[taclink.Frame]:
    found: list[taclink.Frame] = []
    while len(found) < count:
        content = next(replay).content
        if isinstance(content, taclink.Frame):
            found.append(content)
    return found


def test_a_replay_is_steered(client: taclink.Client, recorded: Recorded) -> None:
    with client.replay(recorded.name, links="idle", paused=True, contacts=False, arm=False) as replay:
        first = next(replay).content
        assert isinstance(first, taclink.ReplayStatus) and first.paused and first.speed == 1
        replay.step(3)
        stepped = frames_of(replay, 3)
        replay.seek(first.from_utc_ns)
        replay.step()
        again = frames_of(replay, 1)
        assert again[0].sequence == stepped[0].sequence
        replay.set_speed(100)
        replay.set_loop(True)
        replay.resume()
        while replay.status is not None and replay.status.loops == 0:
            next(replay)
        replay.pause()
        while replay.status is not None and not replay.status.paused:
            next(replay)
        assert replay.status is not None and replay.status.speed == 100
        pictures = replay.pictures("idle", first.to_utc_ns)
        assert ("idle", pictures.sequence) in recorded.live
        assert [picture.camera for picture in pictures.pictures] == ["top", "bottom"]
        assert pictures.pictures[0].jpeg.startswith(b"\xff\xd8")
        replay.set_loop(False)
        replay.set_speed(0)
        replay.resume()
        for message in replay:
            pass
        # The last message is here a moment before the server has let go of the player.
        give_up = time.monotonic() + 30
        with pytest.raises(taclink.NotFound, match="player"):
            while time.monotonic() < give_up:
                replay.pause()
    with pytest.raises(taclink.InvalidArgument, match="speed"):
        client.replay(recorded.name, speed=1000)
    with pytest.raises(taclink.NotFound, match="none.mcap"):
        client.replay("none.mcap")
    with pytest.raises(taclink.NotFound, match="no link 'none'|none"):
        client.replay(recorded.name, links="none")


def test_a_download_goes_on_where_it_broke_off(
    server: servers.Server, client: taclink.Client, recorded: Recorded, tmp_path: Path
) -> None:
    whole = (server.folder / "logs" / recorded.name).read_bytes()
    told: list[tuple[int, int]] = []
    path = client.download_log(recorded.name, tmp_path, on_progress=lambda *each: told.append((each[0], each[1])))
    assert path == tmp_path / recorded.name and path.read_bytes() == whole
    assert told[-1] == (len(whole), len(whole)) and told == sorted(told)

    begun = tmp_path / "copy.mcap.download"
    begun.write_bytes(whole[:-1000])
    told.clear()
    target = tmp_path / "copy.mcap"
    client.download_log(recorded.name, target, on_progress=lambda *each: told.append((each[0], each[1])))
    assert (tmp_path / "copy.mcap").read_bytes() == whole and not begun.exists()
    assert told == [(len(whole), len(whole))]

    begun.write_bytes(whole + b"more")
    with pytest.raises(taclink.OutOfRange, match="copy.mcap.download is of another log; delete it"):
        client.download_log(recorded.name, tmp_path / "copy.mcap")
    assert begun.exists()
    with pytest.raises(taclink.NotFound):
        client.download_log("none.mcap", tmp_path / "none.mcap")
    assert not (tmp_path / "none.mcap.download").exists()


def test_a_download_that_is_cut_short_stays(client: taclink.Client, recorded: Recorded, tmp_path: Path) -> None:
    def stop(taken: int, size: int) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        client.download_log(recorded.name, tmp_path / "a", on_progress=stop)
    assert (tmp_path / "a.download").stat().st_size > 0 and not (tmp_path / "a").exists()
    assert client.download_log(recorded.name, tmp_path / "a") == tmp_path / "a"


def test_logs_are_deleted_and_recordings_refused(client: taclink.Client, measuring: None) -> None:
    with pytest.raises(taclink.Refused, match="nothing is being recorded"):
        client.stop_recording()
    with pytest.raises(taclink.InvalidArgument, match="configured, none, zstd, lz4, not 'zip'"):
        client.start_recording(compression="zip")
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        client.start_recording(links="none")
    client.start_recording("short", links="idle")
    try:
        with pytest.raises(taclink.Refused):
            client.start_recording()
        status = client.recorder()
        assert status.state == taclink.RecorderState.RECORDING and status.folder and status.free_bytes > 0
        (log,) = [log for log in client.logs() if log.open]
        with pytest.raises(taclink.Refused):
            client.delete_log(log.name)
        servers.until(lambda: client.recorder().frames > 2, "some frames are recorded")
    finally:
        name = client.stop_recording().log
    assert {log.name: log.links for log in client.logs()}[name] == ("idle",)
    client.delete_log(name)
    assert name not in {log.name for log in client.logs()}
    with pytest.raises(taclink.NotFound):
        client.delete_log(name)
    with pytest.raises(taclink.NotFound):
        client.describe_log(name)
