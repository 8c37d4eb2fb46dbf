"""The server under test: a process that ends and is started again, life after life."""

from __future__ import annotations

import mmap
import os
import resource
import signal
import struct
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable

PATIENCE_S = 180.0
SERVED_AT = "listening on "
PAGE_AT = "web page at "


def until(condition: Callable[[], Any], patience_s: float = PATIENCE_S) -> Any:
    """Polls; its first true value, or the last one."""
    deadline = time.monotonic() + patience_s
    while True:
        value = condition()
        if value or time.monotonic() > deadline:
            return value
        time.sleep(0.05)


def child(command: list[str], **options: Any) -> "subprocess.Popen[bytes]":
    """Dies with this program, whatever ends that. To be called from the main thread, which it is tied to."""
    return subprocess.Popen(["setpriv", "--pdeathsig", "KILL", *command], stdin=subprocess.DEVNULL, **options)


@dataclass(frozen=True)
class Use:
    """What a process holds."""

    descriptors: int
    threads: int
    memory_mb: float

    def over(self, before: "Use", slack: "Use") -> list[str]:
        """What is more than it was, by more than the slack."""
        out = []
        for name in ("descriptors", "threads", "memory_mb"):
            now, then = getattr(self, name), getattr(before, name)
            if now > then + getattr(slack, name):
                out.append(f"{name} {now:.0f} after {then:.0f}")
        return out


class StepClock:
    """The server's wall clock, beside the machine's."""

    def __init__(self, file: Path) -> None:
        file.write_bytes(bytes(8))
        with open(file, "r+b") as opened:
            self._bytes = mmap.mmap(opened.fileno(), 8)
        self.file = file

    def set(self, seconds: float) -> None:
        self._bytes[:] = struct.pack("<q", round(seconds * 1e9))


class Server:
    def __init__(self, folder: Path, program: Path, clock: StepClock, clock_library: Path) -> None:
        self.folder, self.life = folder, 0
        self.socket = folder / "socket"
        self.address = f"unix:{self.socket}"
        self.web = ""
        self.ended_by: dict[int, str] = {}  # the fault that ended each life
        self.ended_well: set[int] = set()  # lives that could close their logs
        self._command = [str(program), "--config", "arm.yaml", "--listen", self.address]
        self._command += ["--http-listen", "127.0.0.1:0", "--log-level", "debug"]  # gRPC's own words, too
        self._environment = os.environ | {
            "LD_PRELOAD": str(clock_library),
            "TACLINK_STEP_CLOCK": str(clock.file),
            "TZ": "Europe/Berlin",
        }
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def start(self) -> bool:
        """False: it ended, or did not listen in time."""
        self.life += 1
        with open(self.log_file(self.life), "wb") as log:
            self._process = child(
                self._command, cwd=self.folder, env=self._environment, stdout=log, stderr=subprocess.STDOUT
            )
        until(lambda: self._told(SERVED_AT) or not self.lives())
        self.web = self._told(PAGE_AT)
        return self.lives() and bool(self._told(SERVED_AT))

    def lives(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def log_file(self, life: int) -> Path:
        return self.folder / f"server-{life}.log"

    def log(self) -> str:
        return self.log_file(self.life).read_text(errors="replace")

    def signal(self, number: int) -> None:
        assert self._process is not None
        if self.lives():
            self._process.send_signal(number)

    def end(self, number: int, fault: str) -> int:
        """Its exit status; negative: the signal that ended it."""
        assert self._process is not None
        self.ended_by[self.life] = fault
        self.signal(number)
        self.signal(signal.SIGCONT)
        try:
            status = self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return -signal.SIGALRM
        if status == 0:
            self.ended_well.add(self.life)
        return status

    def exit_status(self) -> int | None:
        return None if self._process is None else self._process.poll()

    def use(self) -> Use:
        root = Path("/proc") / str(self.pid)
        fields = dict(
            line.split(":", 1) for line in (root / "status").read_text().splitlines() if ":" in line
        )
        return Use(
            descriptors=len(os.listdir(root / "fd")),
            threads=int(fields["Threads"]),
            memory_mb=int(fields["VmRSS"].split()[0]) / 1024,
        )

    def limit(self, what: int, soft: int) -> tuple[int, int]:
        """What the limit was before."""
        hard = resource.prlimit(self.pid, what)[1]
        return resource.prlimit(self.pid, what, (soft, hard))

    def _told(self, mark: str) -> str:
        text = self.log().partition(mark)[2]
        return text.splitlines()[0].strip() if "\n" in text else ""
