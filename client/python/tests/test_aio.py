"""Every method of the client for asyncio once; what they mean is tested with the client that blocks."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import wraps
from pathlib import Path

import grpc
import numpy as np
import pytest
import server as servers

import taclink
import taclink.aio
from taclink.aio import _waiting

Test = Callable[[servers.Server, taclink.aio.Client], Awaitable[None]]


def with_client(test: Test) -> Callable[[servers.Server, None, None], None]:
    """Of the shared server, `pressed` touched and `idle` measuring."""

    @wraps(test)
    def run(server: servers.Server, touched: None, measuring: None) -> None:
        async def main() -> None:
            async with taclink.aio.Client(server.address, timeout=servers.PATIENCE_S) as client:
                await test(server, client)

        asyncio.run(main())

    del run.__wrapped__  # type: ignore[attr-defined]  # pytest takes the fixtures from it
    return run


@with_client
async def test_the_arm_and_its_streams(server: servers.Server, client: taclink.aio.Client) -> None:
    arm = await client.arm()
    assert [link.name for link in arm.links] == ["pressed", "idle"]
    assert (await client.caller()).role == "operator"
    async with client.frames("pressed", "full") as frames:
        assert frames.counts[0].link == "pressed" and frames.queue_capacity > 0
        frame = await anext(frames)
        assert frame.nodal_forces_n.sum(axis=0) == pytest.approx(frame.total_force_n, abs=1e-5)
        assert (await anext(frames)).gap is not None
    async for contacts in client.contacts(max_rate_hz=5):
        assert np.linalg.norm(contacts.total_force_n) == pytest.approx(0.2, rel=0.1)
        break
    async with client.events(after=taclink.EventPlace()) as events:
        assert (await anext(events)).sequence == 1 and events.place is not None
    async for preview in client.preview("idle"):
        assert preview.pictures[0].jpeg.startswith(b"\xff\xd8")
        break


@with_client
async def test_refusals_come_in_place_of_the_first_message(server: servers.Server, client: taclink.aio.Client) -> None:
    with pytest.raises(taclink.NotFound, match="no link 'none'; this arm has"):
        async with client.frames("none"):
            pass
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        async for _ in client.events("none"):
            pass
    with pytest.raises(taclink.NotFound, match="no link 'none'"):
        await anext(client.preview("none"))
    with pytest.raises(taclink.InvalidArgument, match="contacts, geometry, full"):
        client.frames(detail="all")
    refused = client.frames("none")
    with pytest.raises(taclink.NotFound):
        await anext(refused)
    assert [frame async for frame in refused] == []


@with_client
async def test_operations(server: servers.Server, client: taclink.aio.Client) -> None:
    pressed, idle = await client.tare(frames=2)
    assert idle.accepted and not pressed.accepted
    told: list[tuple[int, int]] = []
    result = await client.calibrate("idle", pairs=3, on_progress=lambda *each: told.append((each[0], each[1])))
    assert result.rms_px < 1 and told and told[-1][1] == 3
    with pytest.raises(taclink.Refused, match="touched"):
        await client.calibrate("pressed")
    state = await client.set_thresholds("idle", warning_n=0.5)
    assert state.thresholds.warning_n == 0.5
    await client.set_force_model("idle", "linear")
    await client.set_camera("idle", gain=1)
    with pytest.raises(taclink.NotFound):
        await client.restart_link("none")


@with_client
async def test_writers(server: servers.Server, client: taclink.aio.Client) -> None:
    with pytest.raises(taclink.Refused, match="no URDF"):
        async with client.update_joint_states() as joints:
            await joints.write({"elbow": 0.0})
    pressures = client.update_pressure()
    await pressures.write(100.0, link="idle")
    with pytest.raises(taclink.Refused, match="source: grpc"):
        for _ in range(1000):  # the answer may come late
            await pressures.write(100.0)
    with pytest.raises(taclink.Refused, match="source: grpc"):
        await pressures.finish()
    async with client.update_pressure() as nothing:
        pass
    assert nothing.summary == taclink.PressureSummary(accepted=0, refused=0)
    with pytest.raises(taclink.Cancelled, match="finished"):
        await nothing.write(0.0)
    with pytest.raises(ZeroDivisionError):
        async with client.update_pressure() as dropped:
            await dropped.write(0.0, link="idle")
            raise ZeroDivisionError


async def play(client: taclink.aio.Client, log: str, streamed: set[tuple[str, int]]) -> None:
    async with client.replay(log, paused=True) as replay:
        assert replay.status is not None and replay.status.paused
        await replay.step()
        await replay.seek(replay.status.from_utc_ns)
        await replay.set_loop(True)
        await replay.set_loop(False)
        await replay.set_speed(0)
        with pytest.raises(taclink.Refused, match="picture"):
            await replay.pictures("idle", replay.status.to_utc_ns)
        await replay.pause()
        await replay.resume()
        contents = [message.content async for message in replay]
    frames = [content for content in contents if isinstance(content, taclink.Frame)]
    assert len(streamed & {(frame.link, frame.sequence) for frame in frames}) > 5
    assert isinstance(contents[-1], taclink.ReplayStatus) and contents[-1].ended


def test_recordings(server: servers.Server, touched: None, measuring: None, tmp_path: Path) -> None:
    async def main() -> None:
        async with taclink.aio.Client(server.address, timeout=servers.PATIENCE_S) as client:
            streamed = set()
            async with client.frames(every=True) as frames:
                await anext(frames)
                await client.start_recording("aio", note="by asyncio")
                for _ in range(20):
                    frame = await anext(frames)
                    streamed.add((frame.link, frame.sequence))
                status = await client.stop_recording()
            assert (await client.recorder()).log == status.log
            assert status.log in {log.name for log in await client.logs()}
            assert (await client.describe_log(status.log)).log.note == "by asyncio"
            await play(client, status.log, streamed)
            path = await client.download_log(status.log, tmp_path)
            assert path.read_bytes() == (server.folder / "logs" / status.log).read_bytes()
            await client.delete_log(status.log)
            with pytest.raises(taclink.NotFound):
                await client.download_log(status.log, tmp_path)

    asyncio.run(main())


@with_client
async def test_a_loop_that_is_left_leaves_no_stream(server: servers.Server, client: taclink.aio.Client) -> None:
    def none() -> bool:
        return server.open_streams() == 0

    await asyncio.to_thread(servers.until, none, "no stream is left of tests before")
    async for _ in client.frames():
        assert server.open_streams() == 1
        break
    await asyncio.to_thread(servers.until, none, "the frames' stream has ended")
    held = client.frames()
    await anext(held)
    await held.close()
    assert [frame async for frame in held] == []
    await asyncio.to_thread(servers.until, none, "the closed stream has ended")


@with_client
async def test_patience_does_not_end_a_stream(server: servers.Server, client: taclink.aio.Client) -> None:
    async with client.events(kinds="tare") as events:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(anext(events), 0.05)
        await client.tare("idle", frames=1)
        assert (await anext(events)).kind == "tare"


@with_client
async def test_closing_ends_what_waits(server: servers.Server, client: taclink.aio.Client) -> None:
    async def drain(stream: taclink.aio.EventStream) -> list[taclink.Event]:
        return [event async for event in stream]

    first, second = (client.events(kinds="calibration") for _ in range(2))
    async with first, second:
        waiting = [asyncio.ensure_future(drain(stream)) for stream in (first, second)]
        await first.close()
        assert await waiting[0] == []
        await client.close()
        assert await waiting[1] == []
    with pytest.raises(taclink.Cancelled, match="closed"):
        await client.arm()


class CallThatFailsAsItIsCancelled:
    """The server goes away in the moment in which nobody waits any more."""

    def __init__(self) -> None:
        self._over = asyncio.Event()

    async def read(self) -> object:
        try:
            await self._over.wait()
        except asyncio.CancelledError:
            pass
        nothing = grpc.aio.Metadata()
        raise grpc.aio.AioRpcError(grpc.StatusCode.UNAVAILABLE, nothing, nothing, "gone")

    def cancel(self) -> None:
        self._over.set()


@pytest.mark.parametrize("ended_by", ["the loop", "the task"])
def test_a_read_that_nobody_waits_for_fails_in_silence(ended_by: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_waiting.Channel, "start", lambda *_: CallThatFailsAsItIsCancelled())
    told: list[dict[str, object]] = []

    async def main() -> "asyncio.Task[object]":
        asyncio.get_running_loop().set_exception_handler(lambda _, what: told.append(what))
        client = taclink.aio.Client("unix:none")
        waiting = asyncio.ensure_future(anext(client.frames()))
        await asyncio.sleep(0.01)
        if ended_by == "the task":
            waiting.cancel()
            await asyncio.wait((waiting,))
        return waiting

    assert asyncio.run(main()).cancelled()
    assert told == []
