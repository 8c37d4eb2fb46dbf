"""Prints contacts and events as they come, with asyncio."""

from __future__ import annotations

import argparse
import asyncio

import numpy as np
from common import options, run

import taclink
import taclink.aio


async def print_frames(client: taclink.aio.Client) -> None:
    async for frame in client.frames(max_rate_hz=2):
        late = "" if frame.latency_s is None else f"  {frame.latency_s * 1e3:.1f} ms old"
        print(f"{frame.link:<12} {frame.status:<12} {len(frame.contacts)} contacts  {frame.total_magnitude_n:.2f} N{late}", flush=True)


async def print_events(client: taclink.aio.Client) -> None:
    async for event in client.events(after=taclink.EventPlace()):
        text = f"event {event.sequence}: {event.kind} of {event.link or 'the arm'}"
        if isinstance(event.detail, taclink.ContactEvent):
            text += f", {np.linalg.norm(event.detail.force_n):.2f} N"
        print(text, flush=True)


async def print_both(arguments: argparse.Namespace) -> None:
    async with taclink.aio.Client(arguments.server, token=arguments.token, ca_file=arguments.tls_ca) as client:
        both = [asyncio.create_task(print_frames(client)), asyncio.create_task(print_events(client))]
        try:
            await asyncio.wait_for(asyncio.gather(*both), arguments.seconds or None)
        except asyncio.TimeoutError:
            pass
        finally:
            for task in both:  # gather leaves the other one running when one fails
                task.cancel()
            await asyncio.gather(*both, return_exceptions=True)


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--seconds", type=float, default=0, help="end after so long (0: never)")
    arguments = parser.parse_args()
    asyncio.run(print_both(arguments))


run(main)
