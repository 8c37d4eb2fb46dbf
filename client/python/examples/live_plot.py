"""Plots the force on each link over time, live; with --save into a file, without a display."""

from __future__ import annotations

import threading
import time
from collections import defaultdict, deque
from typing import Any

import matplotlib
import numpy as np
from common import connect, options, run

import taclink

SHOWN_S = 20.0


class Forces:
    """The newest forces of each link: time since the start, s, and the sum of the contact magnitudes, N."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._start_ns = time.time_ns()
        self._by_link: dict[str, deque[tuple[float, float]]] = defaultdict(lambda: deque(maxlen=2000))

    def age_s(self) -> float:
        return (time.time_ns() - self._start_ns) * 1e-9

    def take(self, frame: taclink.Frame) -> None:
        if frame.times.exposure_utc_ns == 0:
            return  # a sign of life without a picture
        time_s = (frame.times.exposure_utc_ns - self._start_ns) * 1e-9
        with self._lock:
            self._by_link[frame.link].append((time_s, frame.total_magnitude_n))

    def draw(self, axes: Any) -> None:
        axes.clear()
        with self._lock:
            for link, points in sorted(self._by_link.items()):
                axes.plot(*zip(*points), label=link)
        end_s = self.age_s()
        axes.set(xlabel="time, s", ylabel="force, N", xlim=(max(0.0, end_s - SHOWN_S), max(end_s, 1.0)))
        axes.set_ylim(bottom=0)
        if axes.has_data():
            axes.legend(loc="upper left")


def show(frames: taclink.FrameStream, forces: Forces, seconds: float) -> None:
    from matplotlib import animation, pyplot

    def read() -> None:
        for frame in frames:
            forces.take(frame)

    threading.Thread(target=read, daemon=True).start()
    figure, axes = pyplot.subplots()

    def update(_: int) -> None:
        forces.draw(axes)
        if 0 < seconds < forces.age_s():
            pyplot.close(figure)

    moving = animation.FuncAnimation(figure, update, interval=100, cache_frame_data=False)
    pyplot.show()
    del moving  # must live until here


def save(frames: taclink.FrameStream, forces: Forces, seconds: float, path: str) -> None:
    from matplotlib import pyplot

    for frame in frames:
        forces.take(frame)
        if forces.age_s() > (seconds or SHOWN_S):
            break
    figure, axes = pyplot.subplots()
    forces.draw(axes)
    figure.savefig(path)
    print(f"{path} written")


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--seconds", type=float, default=0, help="end after so long (0: never; with --save: 20)")
    parser.add_argument("--save", metavar="FILE.png", help="write the plot there in place of showing it")
    arguments = parser.parse_args()
    if arguments.save:
        matplotlib.use("Agg")
    forces = Forces()
    with connect(arguments) as client:
        with client.frames(max_rate_hz=30, reconnect=True, on_reconnect=tell) as frames:
            if arguments.save:
                save(frames, forces, arguments.seconds, arguments.save)
            else:
                show(frames, forces, arguments.seconds)


def tell(error: taclink.TaclinkError, attempt: int, delay_s: float) -> None:
    print(f"{error}; try {attempt} in {delay_s:.1f} s", flush=True)


run(main)
