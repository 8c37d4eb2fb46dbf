"""Clients of other kinds than frames; each tells by `progress` that it lives."""

from __future__ import annotations

import re
import subprocess
import threading
import time
import urllib.request
from pathlib import Path
from typing import Any, Callable

from audit import SAMPLE, Auditor
from lives import Server, child
from verdict import Verdict

import taclink

PAUSE_S = 0.3
CALL_S = 10.0


class Client:
    """Does the same over and over in a thread of its own; faults are no reason to give up."""

    def __init__(self, name: str, step: Callable[["Client"], None]) -> None:
        self.name = name
        self.progress = 0
        self.closed = threading.Event()
        self.connection: taclink.Client | None = None
        self._step = step
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self.closed.set()
        if self.connection is not None:
            self.connection.close()  # ends its streams, also those that look for the server
        self._thread.join(30)

    def connect(self, address: str) -> taclink.Client:
        self.connection = taclink.Client(address, timeout=CALL_S)
        return self.connection

    def _run(self) -> None:
        while not self.closed.is_set():
            try:
                self._step(self)
            except (taclink.TaclinkError, OSError):
                pass
            self.closed.wait(PAUSE_S)


def contacts(address: str) -> Client:
    def step(self: Client) -> None:
        with self.connect(address) as client:
            with client.contacts(reconnect=True) as stream:
                for _ in stream:
                    self.progress += 1
                    if self.closed.is_set():
                        return

    return Client("contacts", step)


def events(address: str, verdict: Verdict) -> Client:
    """None is missing, nor comes twice, also over breaks, within one run of the server."""

    def step(self: Client) -> None:
        with self.connect(address) as client:
            with client.events(after=taclink.EventPlace(), reconnect=True) as stream:
                run, last = "", 0
                for event in stream:
                    now_run = stream.place.run_id if stream.place else ""
                    if now_run == run and event.sequence != last + 1:
                        verdict.wrong(f"event {event.sequence} came after {last}")
                    run, last = now_run, event.sequence
                    self.progress += 1
                    if self.closed.is_set():
                        return

    return Client("events", step)


def replay(address: str, verdict: Verdict) -> Client:
    """Of a log that no fault harms, whatever else happens."""

    def step(self: Client) -> None:
        with self.connect(address) as client:
            with client.replay(SAMPLE, speed=2, detail="contacts", loop=True) as played:
                for message in played:
                    self.progress += 1
                    if isinstance(message.content, taclink.ReplayStatus) and message.content.damaged > 0:
                        verdict.wrong(f"{message.content.damaged} places of the log that is played can't be read")
                    if self.closed.is_set():
                        return

    return Client("replay", step)


class Metrics(Client):
    def __init__(self, server: Server) -> None:
        self.values: dict[str, float] = {}
        self._server = server
        super().__init__("metrics", lambda _: self._poll())

    def _poll(self) -> None:
        with urllib.request.urlopen(self._server.web + "/metrics", timeout=CALL_S) as answer:
            text = answer.read().decode()
        self.values = {name: float(value) for name, value in re.findall(r"^(taclink_\w+) (\S+)$", text, re.M)}
        self.progress += 1


class RecorderWatch(Client):
    """What the recorder tells, and what is synced by that."""

    def __init__(self, server: Server, auditor: Auditor) -> None:
        self.status: taclink.RecorderStatus | None = None
        self.troubles: list[tuple[float, str]] = []  # when they were first seen
        self._server, self._auditor = server, auditor
        super().__init__("recorder", lambda _: self._poll())

    def is_recording(self) -> bool:
        return self.status is not None and self.status.state == taclink.RecorderState.RECORDING

    def told_since(self, at: float, words: str) -> bool:
        return any(when >= at and words in text for when, text in self.troubles)

    def _poll(self) -> None:
        connection = self.connection or self.connect(self._server.address)
        life, asked_at = self._server.life, time.monotonic()
        try:
            status = connection.recorder()
        except taclink.TaclinkError:
            connection.close()
            self.connection = None
            raise
        if life != self._server.life:
            return
        before, self.status = self.status, status
        if status.last_trouble and (before is None or status.last_trouble_utc_ns != before.last_trouble_utc_ns):
            self.troubles.append((time.monotonic(), status.last_trouble))
        self._auditor.syncs.take(life, asked_at, status.synced_utc_ns)
        self.progress += 1


class WatchProcess:
    """`taclink watch` in a process that can be stopped and killed; started again by `revive`, in the main thread."""

    name = "watch process"

    def __init__(self, program: Path, address: str, folder: Path) -> None:
        self._command = [str(program), "watch", "--server", address, "--every", "--json", "--patience", "60"]
        self._file = folder / "watch.jsonl"
        self.process: subprocess.Popen[bytes] | None = None

    @property
    def progress(self) -> int:
        return self._file.stat().st_size if self._file.exists() else 0

    def revive(self) -> int:
        """How the last one ended, if it did; else 0."""
        status = 0 if self.process is None else self.process.poll()
        if self.process is None or status is not None:
            with open(self._file, "wb") as out:
                self.process = child(self._command, stdout=out, stderr=subprocess.DEVNULL)
        return status or 0

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()


def all_progress(clients: list[Any]) -> dict[str, int]:
    return {client.name: client.progress for client in clients}
