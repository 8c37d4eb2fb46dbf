"""What a fault is, and those of processes and of the network."""

from __future__ import annotations

import random
import signal
import socket
from pathlib import Path
from typing import Any

from world import World, pick


class Fault:
    """`begin`, then `check` that what must be told is, some seconds, then `end`. What it is like follows from `rng`."""

    name = ""
    # Whatever else happens meanwhile, it can be ended; so others may come into it.
    takes_others = False
    # It may come into others.
    comes_into_others = False

    def __init__(self, rng: random.Random) -> None:
        self.seconds = pick(rng, 1, 3)

    @staticmethod
    def why_not(world: World) -> str:
        """Why it can't be tried here; empty: it can."""
        return ""

    def begin(self, world: World) -> None:
        raise NotImplementedError

    def check(self, world: World) -> None:
        pass

    def end(self, world: World) -> None:
        pass

    def note(self) -> str:
        return f"{self.seconds:g} s"


class Momentary(Fault):
    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = 0.0

    def note(self) -> str:
        return ""


class Kill(Momentary):
    name = "server killed"
    comes_into_others = True

    def begin(self, world: World) -> None:
        world.end_life(signal.SIGKILL, self.name)
        world.start()


class KillTwice(Momentary):
    name = "killed while it mends"

    def begin(self, world: World) -> None:
        for _ in range(2):
            world.end_life(signal.SIGKILL, self.name)
            world.start()


class Restart(Momentary):
    name = "server restarted"
    comes_into_others = True

    def begin(self, world: World) -> None:
        world.end_life(signal.SIGTERM, self.name)
        world.start()


class Freeze(Fault):
    name = "server stopped"
    comes_into_others = True
    takes_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = pick(rng, 0.5, 3)

    def begin(self, world: World) -> None:
        world.server.signal(signal.SIGSTOP)

    def end(self, world: World) -> None:
        world.server.signal(signal.SIGCONT)


class BadReload(Fault):
    name = "bad configuration, SIGHUP"

    def begin(self, world: World) -> None:
        self._file = world.folder / "arm.yaml"
        self._good = self._file.read_text()
        self._log_size = len(world.server.log())
        self._file.write_text(self._good.replace("links:", "lonks:"))
        world.server.signal(signal.SIGHUP)

    def check(self, world: World) -> None:
        world.told(self.name, lambda: "SIGHUP" in world.server.log()[self._log_size :], "that nothing is taken over")

    def end(self, world: World) -> None:
        self._file.write_text(self._good)
        world.server.signal(signal.SIGHUP)


class ClientKilled(Momentary):
    name = "client killed"
    comes_into_others = True

    def begin(self, world: World) -> None:
        if world.watcher.process is not None:
            world.watcher.process.kill()
            world.watcher.process.wait()


class ClientStopped(Fault):
    name = "client stopped"
    takes_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self.seconds = pick(rng, 2, 8)

    def begin(self, world: World) -> None:
        self._process: Any = world.watcher.process
        self._process.send_signal(signal.SIGSTOP)

    def end(self, world: World) -> None:
        self._process.send_signal(signal.SIGCONT)


class NetworkReset(Momentary):
    name = "connections reset"
    comes_into_others = True

    def begin(self, world: World) -> None:
        world.proxy.reset()


class NetworkStall(Fault):
    name = "network stalls"
    takes_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        # Also longer than the clients' patience, who then come back.
        self.seconds = pick(rng, 1, 20 if rng.random() < 0.3 else 6)

    def begin(self, world: World) -> None:
        world.proxy.stall()

    def end(self, world: World) -> None:
        world.proxy.flow()


class NetworkCut(Momentary):
    name = "cut within a message"
    comes_into_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._bytes = rng.randrange(1, 3000)

    def begin(self, world: World) -> None:
        world.proxy.cut_after(self._bytes)

    def note(self) -> str:
        return f"after {self._bytes} bytes"


class Garbage(Momentary):
    """What does not speak the server's language, some of it in HTTP/2's own words."""

    name = "garbage sent"
    comes_into_others = True

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
        self._texts = [(preface if rng.random() < 0.5 else b"") + rng.randbytes(rng.randrange(1, 3000)) for _ in "1234"]

    def begin(self, world: World) -> None:
        page = world.server.web.rpartition("/")[2].rpartition(":")
        for text in self._texts:
            for address in (world.server.socket, (page[0], int(page[2]))):
                self._send(address, text)

    @staticmethod
    def _send(address: Any, text: bytes) -> None:
        with socket.socket(socket.AF_UNIX if isinstance(address, Path) else socket.AF_INET) as out:
            out.settimeout(5)
            try:
                out.connect(str(address) if isinstance(address, Path) else address)
                out.sendall(text)
                out.recv(1000)
            except OSError:
                pass


ALL = (
    Kill,
    KillTwice,
    Restart,
    Freeze,
    BadReload,
    ClientKilled,
    ClientStopped,
    NetworkReset,
    NetworkStall,
    NetworkCut,
    Garbage,
)
