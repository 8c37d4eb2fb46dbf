"""Servers that go and come back, or hang."""

from __future__ import annotations

import asyncio
import signal
import tempfile
import time
from pathlib import Path
from typing import Iterator

import pytest
import server as servers

import taclink
import taclink.aio


@pytest.fixture
def mortal() -> Iterator[servers.Server]:
    """Comes back at the same address: a port could be another program's by then."""
    with tempfile.TemporaryDirectory() as folder:
        config = servers.HEAD + servers.links(servers.link("skin", "rest"))
        running = servers.Server(Path(folder), config, f"unix:{folder}/socket")
        yield running
        running.stop()


class Restart:
    """Starts the server again at the second try."""

    def __init__(self, server: servers.Server) -> None:
        self.server = server
        self.told: list[tuple[taclink.TaclinkError, int, float]] = []

    def __call__(self, error: taclink.TaclinkError, attempt: int, delay_s: float) -> None:
        self.told.append((error, attempt, delay_s))
        if attempt == 2:
            self.server.start()

    def check(self) -> None:
        assert [attempt for _, attempt, _ in self.told] == list(range(1, len(self.told) + 1))
        assert len(self.told) >= 2 and all(0 < delay_s <= 2 for _, _, delay_s in self.told)
        assert all(isinstance(error, taclink.Unavailable) for error, _, _ in self.told)
        assert "the call to the server at" in str(self.told[0][0])


def test_frames_go_on_after_a_crash(mortal: servers.Server) -> None:
    restart = Restart(mortal)
    with taclink.Client(mortal.address, timeout=servers.PATIENCE_S) as client:
        with client.frames(every=True, reconnect=True, on_reconnect=restart) as frames:
            last = next(frames)
            mortal.kill()
            killed_ns = time.time_ns()
            while last.times.exposure_utc_ns < killed_ns:
                last = next(frames)
            assert last.link == "skin"
            restart.check()
            restart.told.clear()
            next(frames)
            assert restart.told == []


def test_events_go_on_in_the_next_run(mortal: servers.Server) -> None:
    restart = Restart(mortal)
    with taclink.Client(mortal.address, timeout=servers.PATIENCE_S) as client:
        with client.events(after=taclink.EventPlace(), reconnect=True, on_reconnect=restart) as events:
            assert next(events).sequence == 1
            place = events.place
            assert place is not None and not events.run_changed
            mortal.kill()
            while events.place is not None and events.place.run_id == place.run_id:
                event = next(events)
            assert event.sequence == 1 and events.run_changed
            restart.check()


def test_contacts_go_on_with_asyncio(mortal: servers.Server) -> None:
    restart = Restart(mortal)

    async def watch() -> None:
        async with taclink.aio.Client(mortal.address, timeout=servers.PATIENCE_S) as client:
            async with client.contacts(reconnect=True, on_reconnect=restart) as contacts:
                first = await anext(contacts)
                assert first.sequence == 1
                mortal.kill()
                killed_ns = time.time_ns()
                async for arm in contacts:
                    if arm.utc_ns > killed_ns:
                        break
                assert arm.sequence == 1
                restart.check()

    asyncio.run(watch())


def test_without_it_the_end_is_an_error(mortal: servers.Server) -> None:
    with taclink.Client(mortal.address, timeout=servers.PATIENCE_S) as client:
        frames = client.frames()
        next(frames)
        mortal.stop()
        with pytest.raises(taclink.Unavailable, match="the server at .* ended the stream: .*shutting down"):
            for _ in frames:
                pass
        assert list(frames) == []
        with pytest.raises(taclink.Unavailable, match="no server answers at .*; start taclinkd there"):
            client.frames(reconnect=True)  # the first opening is not retried
        with pytest.raises(taclink.Unavailable, match="no server answers"):
            client.arm()


def test_a_callback_may_give_up(mortal: servers.Server) -> None:
    def give_up(error: taclink.TaclinkError, attempt: int, delay_s: float) -> None:
        raise error

    with taclink.Client(mortal.address, timeout=servers.PATIENCE_S) as client:
        frames = client.frames(reconnect=True, on_reconnect=give_up)
        next(frames)
        mortal.kill()
        with pytest.raises(taclink.Unavailable, match="the call to the server at .* failed"):
            for _ in frames:
                pass
        assert list(frames) == []


def test_a_stream_may_be_closed_between_tries(mortal: servers.Server) -> None:
    with taclink.Client(mortal.address, timeout=servers.PATIENCE_S) as client:
        frames = client.frames(reconnect=True, on_reconnect=lambda *_: frames.close())
        next(frames)
        mortal.kill()
        for _ in frames:
            pass


def test_a_server_that_hangs_is_a_timeout(mortal: servers.Server) -> None:
    with taclink.Client(mortal.address, timeout=0.5) as client:
        mortal.pause()
        try:
            with pytest.raises(taclink.Timeout, match="did not answer in time"):
                client.arm()
            with pytest.raises(taclink.Timeout, match="did not answer in time"):
                client.frames()

            async def ask() -> None:
                async with taclink.aio.Client(mortal.address, timeout=0.5) as other:
                    with pytest.raises(taclink.Timeout):
                        await other.arm()
                    with pytest.raises(taclink.Timeout):
                        await anext(other.frames())

            asyncio.run(ask())
        finally:
            mortal.signal(signal.SIGCONT)
