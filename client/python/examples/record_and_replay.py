"""Records some seconds on the server, lists its logs, and plays the new one again."""

from __future__ import annotations

import time

from common import connect, options, run

import taclink


def record(client: taclink.Client, seconds: float) -> str:
    """The log's name."""
    print(f"records {seconds:g} s", flush=True)
    client.start_recording(note="example")
    try:
        time.sleep(seconds)
    finally:
        status = client.stop_recording()
    print(f"{status.log}: {status.frames} frames, {status.bytes} bytes, {status.frames_lost} lost")
    return status.log


def replay(client: taclink.Client, log: str) -> None:
    with client.replay(log, speed=0) as messages:  # as fast as it is read
        for message in messages:
            match message.content:
                case taclink.Frame() as frame:
                    force_n = frame.total_magnitude_n
                    print(f"{message.log_utc_ns}  {frame.link:<12} frame {frame.sequence}  {force_n:5.2f} N")
                case taclink.Event() as event:
                    print(f"{message.log_utc_ns}  {event.link:<12} {event.kind}")
                case taclink.ReplayStatus(ended=True):
                    print("end of the log")
                case _:
                    pass


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--seconds", type=float, default=3, help="to record (%(default)s)")
    arguments = parser.parse_args()
    with connect(arguments) as client:
        name = record(client, arguments.seconds)
        for log in client.logs():
            seconds = (log.end_utc_ns - log.start_utc_ns) * 1e-9
            print(f"  {log.name}  {seconds:.1f} s  {', '.join(log.links)}  {log.frames} frames")
        replay(client, name)


run(main)
