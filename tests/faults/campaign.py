"""Faults one after the other, until the time is over."""

from __future__ import annotations

import argparse
import random
import signal
import sys
import time
from pathlib import Path
from typing import Iterator

import disk_faults
import faults
import machine_faults
from faults import Fault
from verdict import Verdict
from world import Programs, World

OTHER_COMES = 0.3  # probability, where a fault takes others


def deal(kinds: list[type[Fault]], rng: random.Random) -> Iterator[type[Fault]]:
    """Each once in every round."""
    while True:
        yield from rng.sample(kinds, len(kinds))


def may_be_tried(world: World, only: list[str]) -> list[type[Fault]]:
    out = []
    for kind in (*faults.ALL, *disk_faults.ALL, *machine_faults.ALL):
        if only and not any(words in kind.name for words in only):
            continue
        why_not = kind.why_not(world)
        if why_not:
            world.verdict.skipped[kind.name] = why_not
        else:
            out.append(kind)
    return out


def inject(world: World, fault: Fault, other: Fault | None) -> None:
    verdict = world.verdict
    verdict.do(fault.name, fault.note())
    verdict.injected[fault.name] += 1
    try:
        fault.begin(world)
        fault.check(world)
        time.sleep(fault.seconds / 2)
        if other is not None:
            verdict.say(f"  and {other.name} {other.note()}")
            verdict.injected[other.name] += 1
            other.begin(world)
            time.sleep(other.seconds)
            other.end(world)
        time.sleep(fault.seconds / 2)
    finally:
        fault.end(world)
    world.settle()


def repeat(world: World, kinds: list[type[Fault]], rng: random.Random, seconds: float) -> None:
    end = time.monotonic() + seconds
    others = [kind for kind in kinds if kind.comes_into_others]
    for kind in deal(kinds, rng):
        if time.monotonic() > end:
            return
        fault, comes, other_kind = kind(rng), rng.random() < OTHER_COMES, rng.choice(others or kinds)
        other = other_kind(rng)
        takes_it = comes and others and kind.takes_others and other_kind is not kind
        inject(world, fault, other if takes_it else None)


def finish(world: World) -> None:
    """The last life ends well, and is judged as the others were."""
    world.verdict.do("the end")
    world.settle()
    world.end_life(signal.SIGTERM, "the end")
    world.auditor.take_closed(world.server.life)
    left = world.auditor.unfinished(world.server.life + 1)
    if left:
        world.verdict.wrong(f"logs were not closed: {left}")
    for reader in world.readers:
        reader.close()
    world.server.life += 1
    world.audit_past_lives()


def run(arguments: argparse.Namespace, folder: Path, own_disk: bool, seed: int) -> int:
    rng = random.Random(seed)
    verdict = Verdict()
    programs = arguments.programs.resolve()
    world = World(
        folder, Programs(programs / "taclinkd", programs / "taclink", arguments.step_clock.resolve()), own_disk, verdict
    )
    try:
        world.begin()
        kinds = may_be_tried(world, arguments.only)
        repeat(world, kinds, rng, arguments.seconds)
        finish(world)
    finally:
        world.close()
    print(verdict.table())
    auditor = world.auditor
    print(
        f"{world.server.life - 1} lives of the server, {auditor.logs_checked} logs,"
        f" {auditor.frames_checked} frames of {len(world.readers)} clients held against them"
    )
    wrong = sum(verdict.violations.values())
    print(f"seed {seed}: " + (f"{wrong} WRONG" if wrong else "nothing wrong"), file=sys.stderr if wrong else sys.stdout)
    return 1 if wrong or auditor.frames_checked == 0 else 0
