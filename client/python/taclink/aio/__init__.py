"""The client for asyncio.

    async with taclink.aio.Client() as client:
        async for frame in client.frames():
            print(frame.link, frame.total_force_n)

What it gives and raises is taclink's.
"""

from taclink.aio.client import Client
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

__all__ = [
    "AttitudeWriter",
    "Client",
    "ContactStream",
    "EventStream",
    "FrameStream",
    "JointStateWriter",
    "PressureWriter",
    "PreviewStream",
    "Replay",
]
