"""Processes that are forked while, or after, their parent uses a client."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import server as servers

# `in_child` runs `what` in a forked process and prints what became of it. A child that hangs is killed and reported.
PRELUDE = """
import multiprocessing, os, sys, threading
import taclink

ADDRESS, LIMIT_S = sys.argv[1], float(sys.argv[2])

def report(what):
    try:
        print("child:", what(), flush=True)
    except taclink.TaclinkError as error:
        print(type(error).__name__, error, flush=True)

def in_child(what):
    child = multiprocessing.get_context("fork").Process(target=report, args=(what,))
    child.start()
    child.join(LIMIT_S)
    print("hangs" if child.is_alive() else f"exit {child.exitcode}", flush=True)
    child.kill()
    child.join()

def fresh():
    with taclink.Client(ADDRESS) as client:
        return client.arm().name
"""


def lines_of(script: str, library: Path, server: servers.Server, **environment: str) -> list[str]:
    """What the script prints; it ends by itself and well."""
    done = subprocess.run(
        [sys.executable, "-c", PRELUDE + textwrap.dedent(script), server.address, str(servers.PATIENCE_S)],
        cwd=library,  # which Python looks into first
        env=os.environ | {"PYTHONPATH": str(library)} | environment,
        capture_output=True,
        text=True,
        timeout=10 * servers.PATIENCE_S,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


def test_a_forked_child_is_told_and_harms_nobody(library: Path, server: servers.Server) -> None:
    lines = lines_of(
        """
        client = taclink.Client(ADDRESS)
        stream = client.frames()
        next(stream)
        writer = client.update_joint_states()

        def drop():
            stream.close()
            client.close()
            writer.cancel()
            return "dropped"

        for what in (fresh, lambda: client.arm().name, lambda: next(stream).link, writer.finish, drop):
            in_child(what)
        print("parent:", next(stream).link in [link.name for link in client.arm().links])
        client.close()
        """,
        library,
        server,
    )
    refusals, rest = lines[:8], lines[8:]
    assert refusals[1::2] == ["exit 0"] * 4, lines
    for refusal in refusals[::2]:
        assert refusal.startswith("WrongProcess ") and "spawn" in refusal, lines
    assert "had used a client" in refusals[0] and "this client was made in process" in refusals[2]
    assert rest == ["child: dropped", "exit 0", "parent: True"], lines


def test_a_fork_before_the_first_use_is_fine(library: Path, server: servers.Server) -> None:
    lines = lines_of("client = taclink.Client(ADDRESS); in_child(fresh); in_child(lambda: client.arm().name)", library, server)
    assert [line.partition(":")[0] for line in lines] == ["child", "exit 0"] * 2, lines


def test_forks_that_grpc_was_asked_to_support(library: Path, server: servers.Server) -> None:
    closed = "fresh(); in_child(fresh)"
    open_ = "client = taclink.Client(ADDRESS); client.arm(); in_child(fresh); client.close()"
    supported = {"GRPC_ENABLE_FORK_SUPPORT": "1"}
    assert lines_of(closed, library, server, **supported)[0].startswith("child:")
    assert lines_of(open_, library, server, **supported)[0].startswith("WrongProcess")
    assert lines_of(closed, library, server)[0].startswith("WrongProcess")


def test_asyncio_is_told_as_well(library: Path, server: servers.Server) -> None:
    lines = lines_of(
        """
        import asyncio, taclink.aio

        async def main():
            async with taclink.aio.Client(ADDRESS) as client:
                arm = await client.arm()
                in_child(lambda: asyncio.new_event_loop().run_until_complete(client.arm()))
                return (await client.arm()).name == arm.name

        print(asyncio.run(main()))
        """,
        library,
        server,
    )
    assert lines[0].startswith("WrongProcess") and lines[1:] == ["exit 0", "True"], lines
