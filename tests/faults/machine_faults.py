"""Faults of the machine: its clock, its memory, its descriptors, its processors."""

from __future__ import annotations

import calendar
import os
import random
import resource
import sys
import time
from pathlib import Path

from faults import Fault
from frame_readers import FrameReader
from lives import child, until
from world import World, pick

HOUR_S = 3600.0
MB = 1 << 20
LATE_CLIENTS = 8


class ClockStep(Fault):
    name = "clock steps an hour"
    takes_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._step_s = rng.choice((-HOUR_S, HOUR_S))

    def begin(self, world: World) -> None:
        world.clock.set(self._step_s)

    def end(self, world: World) -> None:
        world.clock.set(0)

    def note(self) -> str:
        return f"{self._step_s:+.0f} s for {self.seconds:g} s"


class LeapSecond(ClockStep):
    """One is inserted: the last second of the day comes twice."""

    name = "leap second"

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._step_s = -1.0


class SummerTime(Fault):
    """The server's time zone begins or ends its summer time."""

    name = "summer time"
    takes_others = True

    CHANGES = ("2027-03-28 01:00:00", "2027-10-31 01:00:00")  # UTC, of Europe/Berlin

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = pick(rng, 3, 5)
        self._change = rng.choice(self.CHANGES)

    def begin(self, world: World) -> None:
        change_s = calendar.timegm(time.strptime(self._change, "%Y-%m-%d %H:%M:%S"))
        world.clock.set(change_s - 1.5 - time.time())

    def end(self, world: World) -> None:
        world.clock.set(0)

    def note(self) -> str:
        return f"changes at {self._change} UTC"


class NoDescriptors(Fault):
    """Those who come then are refused, and served later; those that are there go on."""

    name = "no descriptor is free"

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = pick(rng, 2, 5)

    def begin(self, world: World) -> None:
        used = {int(name) for name in os.listdir(f"/proc/{world.server.pid}/fd")}
        lowest_free = next(number for number in range(len(used) + 1) if number not in used)
        self._before = world.server.limit(resource.RLIMIT_NOFILE, lowest_free)
        self._late = [FrameReader(f"late {i}", world.server, world.verdict) for i in range(LATE_CLIENTS)]

    def check(self, world: World) -> None:
        world.told(
            self.name,
            # The log tells the same only so often in a minute.
            lambda: "can't be accepted: Too many open files" in world.server.log(),
            "in the server's log",
        )

    def end(self, world: World) -> None:
        world.server.limit(resource.RLIMIT_NOFILE, self._before[0])
        if not until(lambda: all(reader.frames > 0 for reader in self._late)):
            world.verdict.wrong("who came while no descriptor was free is not served afterwards")
        for reader in self._late:
            reader.close()


class NoMemory(Fault):
    """The server gets no more of it than it has. Where it can't do without, it ends: what was synced is there."""

    name = "out of memory"

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = pick(rng, 2, 5)
        self._spare_mb = rng.choice((0, 1, 8))

    def begin(self, world: World) -> None:
        world.crashes_expected = True
        pages = int(Path(f"/proc/{world.server.pid}/statm").read_text().split()[0])
        size = pages * resource.getpagesize() + self._spare_mb * MB
        self._before = world.server.limit(resource.RLIMIT_AS, size)
        # Work that needs some.
        self._readers = [
            FrameReader(f"hungry {i}", world.server, world.verdict, detail=3, pause_s=0.1) for i in range(6)
        ]

    def end(self, world: World) -> None:
        if world.server.lives():
            world.server.limit(resource.RLIMIT_AS, self._before[0])
        for reader in self._readers:
            reader.close()
        time.sleep(0.5)
        if not world.server.lives():
            world.note_crash()
            world.start()
        world.crashes_expected = False

    def note(self) -> str:
        return f"{self._spare_mb} MB are left, for {self.seconds:g} s"


class Busy(Fault):
    name = "processors busy"
    takes_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = pick(rng, 2, 6)

    def begin(self, world: World) -> None:
        command = [sys.executable, "-c", "while True: pass"]
        self._children = [child(command) for _ in range(2 * (os.cpu_count() or 1))]

    def end(self, world: World) -> None:
        for one in self._children:
            one.kill()
            one.wait()


ALL = (ClockStep, LeapSecond, SummerTime, NoDescriptors, NoMemory, Busy)
