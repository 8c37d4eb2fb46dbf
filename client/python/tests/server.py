"""Servers of simulated arms for tests: real taclinkd processes on free ports, in folders of their own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any, Callable, Optional

import taclink

PROJECT = Path(__file__).resolve().parents[3]
TACLINKD = Path(os.environ.get("TACLINKD", PROJECT / "build" / "dev" / "bin" / "taclinkd"))
TACLINK = Path(os.environ.get("TACLINK", TACLINKD.with_name("taclink")))
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
PATIENCE_S = 120.0
RATE_HZ = 15

SCENE = f"taclink_scene: 1\nname: test\nmodel: cylinder\nframe_rate_hz: {RATE_HZ}\nduration_s: 7200\n"
PRESS = "contacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 4, end_s: 7000, ramp_s: 0.2}\n"
# Frames of any age are as they are: a busy machine must not fail a test.
HEAD = "taclink_config: 1\nlimits: {max_frame_age_s: 3600}\nrecording: {folder: logs}\n"


def until(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """Polls; its first true value."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {patience_s:g} s: {what}")


class Server:
    def __init__(self, folder: Path, config: str, listen: str = "127.0.0.1:0") -> None:
        self.folder = folder
        (folder / "press.yaml").write_text(SCENE + PRESS)
        (folder / "rest.yaml").write_text(SCENE)
        (folder / "arm.yaml").write_text(config)
        self._command = [str(TACLINKD), "--config", "arm.yaml", "--http-listen", "127.0.0.1:0", "--listen", listen]
        self._process: Optional[subprocess.Popen[bytes]] = None
        self.start()

    def start(self) -> None:
        with open(self.folder / "server.log", "wb") as log:
            self._process = subprocess.Popen(
                self._command, cwd=self.folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        self.address = until(lambda: self._told("listening on "), "the server listens")
        self.web = until(lambda: self._told("web page at "), "the web page is there")

    def open_streams(self) -> int:
        """Of all clients."""
        with urllib.request.urlopen(self.web + "/metrics", timeout=PATIENCE_S) as answer:
            found = re.search(r"^taclink_streams (\d+)", answer.read().decode(), re.MULTILINE)
        assert found is not None
        return int(found[1])

    def log(self) -> str:
        return (self.folder / "server.log").read_text(errors="replace")

    def signal(self, number: int) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    def pause(self) -> None:
        """Stops the process, as if it hung; SIGSTOP acts some time after it was sent."""
        self.signal(signal.SIGSTOP)
        assert self._process is not None
        stat = Path(f"/proc/{self._process.pid}/stat")
        until(lambda: stat.read_text().rpartition(")")[2].split()[0] == "T", "the server is stopped")

    def kill(self) -> None:
        """As a crash ends it."""
        self.signal(signal.SIGKILL)
        self._wait()

    def stop(self) -> None:
        if self._process is None or self._process.poll() is not None:
            return
        self.signal(signal.SIGTERM)
        self._wait()

    def _wait(self) -> None:
        assert self._process is not None
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise

    def _told(self, mark: str) -> Optional[str]:
        assert self._process is not None
        text = self.log()
        if mark in text and "\n" in text.partition(mark)[2]:
            return text.partition(mark)[2].splitlines()[0].strip()
        assert self._process.poll() is None, f"the server ended:\n{text}"
        return None


def measuring(folder: Path, config: str, link: str) -> Server:
    """A server whose link has taken its rest shape."""
    server = Server(folder, config)
    with taclink.Client(server.address, timeout=PATIENCE_S) as client:
        next(frame for frame in client.frames(link, every=True) if frame.status == "ok")
    return server


def links(*lines: str) -> str:
    return "arm:\n  name: test\n  links:\n" + "".join(f"    - {{{line}}}\n" for line in lines)


def link(name: str, scene: str, more: str = "") -> str:
    return f"name: {name}, model: cylinder, source: simulated, scene: {scene}.yaml{more}"


def environment_of(library: Path, folder: Path) -> dict[str, str]:
    """Of an example; `folder`: where it may write."""
    environment = os.environ | {"PYTHONPATH": str(library), "PYTHONDONTWRITEBYTECODE": "1", "MPLCONFIGDIR": str(folder)}
    for variable in ("DISPLAY", "TACLINK_SERVER", "TACLINK_TOKEN", "TACLINK_TLS_CA"):
        environment.pop(variable, None)
    return environment


def run_example(library: Path, folder: Path, name: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments],
        cwd=folder,
        env=environment_of(library, folder),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
