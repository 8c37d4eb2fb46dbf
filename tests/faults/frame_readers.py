"""Clients that keep account of each frame that they get, and of each that they are told they did not."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Any, Callable

import grpc
from lives import Server
from verdict import Verdict

from taclink._channel import options, stubs
from taclink.v1 import frame_pb2, tactile_pb2

# Until a stream must have told that it dropped frames: it does so once a second, behind what waits.
TOLD_WITHIN_S = 15.0
PAUSE_S = 0.2


@dataclass
class Stream:
    """One call, from its beginning to its end."""

    life: int
    received: dict[str, dict[int, float]] = field(default_factory=dict)  # by link and sequence: when it came
    messages: dict[str, int] = field(default_factory=dict)  # by link, with those without a picture
    dropped: dict[str, int] = field(default_factory=dict)  # as told last
    end_at: float = 0.0
    end_reason: str = ""


class FrameReader:
    """Reads frames in a thread of its own until it is closed, and comes back whenever the stream breaks."""

    def __init__(
        self,
        name: str,
        server: Server,
        verdict: Verdict,
        address: str = "",
        every: bool = True,
        detail: Any = frame_pb2.DETAIL_CONTACTS,
        pause_s: float = 0.0,
    ) -> None:
        self.name = name
        self.address = address or server.address
        self.streams: list[Stream] = []
        self.frames = 0
        self.newest: dict[str, frame_pb2.LinkFrame] = {}
        self.watch: Callable[[frame_pb2.LinkFrame], None] | None = None
        self._server, self._verdict, self._pause_s = server, verdict, pause_s
        delivery = tactile_pb2.DELIVERY_EVERY if every else tactile_pb2.DELIVERY_LATEST
        self._request = tactile_pb2.StreamFramesRequest(detail=detail, delivery=delivery)
        self._closed = threading.Event()
        self._call: Any = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closed.set()
        if self._call is not None:
            self._call.cancel()
        self._thread.join(30)

    def _run(self) -> None:
        while not self._closed.is_set():
            with grpc.insecure_channel(self.address, options()) as channel:
                try:
                    self._read(stubs(channel)["tactile"])
                except grpc.RpcError:
                    pass
            self._closed.wait(PAUSE_S)

    def _read(self, stub: Any) -> None:
        life = self._server.life
        self._call = call = stub.StreamFrames(self._request)
        try:
            first = next(call)
            # Whoever answered was there before and after.
            if life != self._server.life or first.WhichOneof("message") != "status":
                return
            stream = Stream(life)
            self.streams.append(stream)
            try:
                for message in call:
                    self._take(stream, message)
                    if self._pause_s > 0:
                        self._closed.wait(self._pause_s)
            finally:
                stream.end_at = time.monotonic()
        finally:
            call.cancel()

    def _take(self, stream: Stream, message: Any) -> None:
        if message.WhichOneof("message") == "status":
            self._take_status(stream, message.status)
            return
        frame = message.frame
        stream.messages[frame.link] = stream.messages.get(frame.link, 0) + 1
        self.frames += 1
        self.newest[frame.link] = frame
        if self.watch is not None:
            self.watch(frame)
        if frame.times.exposure_ns == 0:
            return
        received = stream.received.setdefault(frame.link, {})
        if received and frame.sequence <= next(reversed(received)):
            self._wrong(stream, f"{frame.link} frame {frame.sequence} came after {next(reversed(received))}")
        received[frame.sequence] = time.monotonic()

    def _take_status(self, stream: Stream, status: Any) -> None:
        stream.end_reason = status.end_reason
        for counts in status.links:
            had = stream.messages.get(counts.link, 0)
            if counts.frames_sent != had:
                self._wrong(stream, f"{counts.frames_sent} frames of {counts.link} were sent, {had} came")
            stream.dropped[counts.link] = counts.frames_dropped

    def _wrong(self, stream: Stream, what: str) -> None:
        self._verdict.wrong(f"client '{self.name}', life {stream.life}: {what}")


def missed(stream: Stream, link: str, published: set[int]) -> list[int]:
    """Of what was published while the stream was read: what did not come, where that must have been told by now."""
    received = stream.received.get(link, {})
    if not received:
        return []
    told_until = max(received)
    if not stream.end_reason:
        told = [sequence for sequence, at in received.items() if at < stream.end_at - TOLD_WITHIN_S]
        told_until = max(told, default=0)
    return sorted(s for s in published if min(received) < s < told_until and s not in received)
