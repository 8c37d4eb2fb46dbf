"""Reads what a run must know of a log: which frames are in it, and which it says are not.

By itself, for the server's own reader is among what is judged; of chunks that are compressed, `taclink log cut` makes
others first.
"""

from __future__ import annotations

import struct
import subprocess
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Iterator

from taclink.v1 import log_pb2

MAGIC = b"\x89MCAP0\r\n"
RECORDS = {"channel": 0x04, "message": 0x05, "chunk": 0x06, "metadata": 0x0C}


@dataclass
class LogContent:
    frames: dict[str, Counter[int]] = field(default_factory=dict)  # sequences by link, of frames with a picture
    frame_messages: int = 0  # with those that only tell a status
    losses: list[log_pb2.RecordingLoss] = field(default_factory=list)
    totals: dict[str, str] = field(default_factory=dict)  # empty: never closed


class Compressed(Exception):
    """Its chunks must be made plain first."""


def _records(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    at = 0
    while at + 9 <= len(data):
        kind, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > len(data):
            return
        yield kind, data[at + 9 : at + 9 + size]
        at += 9 + size


def _text(data: memoryview, at: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<I", data, at)
    return str(data[at + 4 : at + 4 + size], "utf-8"), at + 4 + size


def _plain_chunk(data: memoryview) -> memoryview:
    compression, at = _text(data, 28)
    if compression:
        raise Compressed(compression)
    return data[at + 8 :]


def _text_map(data: memoryview, at: int) -> dict[str, str]:
    (size,) = struct.unpack_from("<I", data, at)
    at, end = at + 4, at + 4 + size
    out = {}
    while at < end:
        key, at = _text(data, at)
        out[key], at = _text(data, at)
    return out


class _Reading:
    def __init__(self) -> None:
        self.content = LogContent()
        self._topics: dict[int, str] = {}

    def take(self, kind: int, data: memoryview) -> None:
        if kind == RECORDS["chunk"]:
            for inner_kind, inner in _records(_plain_chunk(data)):
                self.take(inner_kind, inner)
        elif kind == RECORDS["channel"]:
            (channel,) = struct.unpack_from("<H", data)
            self._topics[channel] = _text(data, 4)[0]
        elif kind == RECORDS["message"]:
            self._take_message(data)
        elif kind == RECORDS["metadata"]:
            name, at = _text(data, 0)
            if name == "taclink.totals":
                self.content.totals = _text_map(data, at)

    def _take_message(self, data: memoryview) -> None:
        channel, sequence, log_ns, publish_ns = struct.unpack_from("<HIQQ", data)
        topic = self._topics[channel]
        if topic == "/losses":
            self.content.losses.append(log_pb2.RecordingLoss.FromString(bytes(data[22:])))
        elif topic.startswith("/links/") and topic.endswith("/frame"):
            self.content.frame_messages += 1
            if publish_ns != log_ns:  # a frame's is its exposure; a status without a picture has none
                self.content.frames.setdefault(topic.split("/")[2], Counter())[sequence] += 1


def read_log(path: Path, taclink_program: Path) -> LogContent:
    """Errors: ValueError (no log), subprocess.CalledProcessError."""
    data = memoryview(path.read_bytes())
    if data[: len(MAGIC)] != MAGIC:
        raise ValueError(f"{path.name} is no MCAP file")
    reading = _Reading()
    try:
        for kind, record in _records(data[len(MAGIC) :]):
            reading.take(kind, record)
    except Compressed:
        plain = path.with_suffix(".plain")
        command = [taclink_program, "log", "cut", path, "-o", plain, "--compression", "none"]
        subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
        try:
            return read_log(plain, taclink_program)
        finally:
            plain.unlink()
    return reading.content
