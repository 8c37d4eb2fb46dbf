"""All that a run consists of, and when it is well again."""

from __future__ import annotations

import calendar
import random
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable

import clients
from audit import Auditor
from clients import Metrics, RecorderWatch, WatchProcess
from frame_readers import FrameReader
from lives import PATIENCE_S, Server, StepClock, Use, until
from proxy import Proxy
from verdict import Verdict

from taclink.v1 import frame_pb2

RATE_HZ = 4
PAIRS = 24
SAMPLE_BYTES = 2_000_000
LINKS = ("still", "pressed", "film", "tape")
MEASURES = (frame_pb2.LINK_STATUS_OK, frame_pb2.LINK_STATUS_DEGRADED)
TOLD_WITHIN_S = 60.0  # for slow machines; how long it took is told
# A server's pools of threads and of memory grow with what came all at once, and keep it.
SLACK = Use(descriptors=6, threads=16, memory_mb=64)

SCENE = f"taclink_scene: 1\nname: faults\nmodel: cylinder\nframe_rate_hz: {RATE_HZ}\nduration_s: 100000\n"
PRESS = "contacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 20, end_s: 99000, ramp_s: 0.2}\n"
CONFIG = """taclink_config: 1
limits: {{queue_mb: 4}}
recording: {{folder: "{logs}", at_start: true, compression: none, sync_s: 0.5, split_s: 20, scene_rate_hz: 1}}
arm:
  name: faults
  links:
    - {{name: still, model: cylinder, source: simulated, scene: still.yaml}}
    - {{name: pressed, model: cylinder, source: simulated, scene: pressed.yaml}}
    - {{name: film, model: cylinder, source: files, folder: film, frame_rate_hz: {rate}, pressure_kpa: 0}}
    - {{name: tape, model: cylinder, source: files, folder: tape, frame_rate_hz: {rate}, pressure_kpa: 0}}
"""


@dataclass(frozen=True)
class Programs:
    taclinkd: Path
    taclink: Path
    step_clock: Path


class World:
    def __init__(self, folder: Path, programs: Programs, own_disk: bool, verdict: Verdict) -> None:
        self.folder, self.programs, self.own_disk, self.verdict = folder, programs, own_disk, verdict
        self.disk = folder / "disk"
        self.logs = self.disk / "logs"
        self.logs.mkdir(parents=True, exist_ok=True)
        self._write_inputs()
        self.clock = StepClock(folder / "clock")
        self.server = Server(folder, programs.taclinkd, self.clock, programs.step_clock)
        self.auditor = Auditor(self.logs, programs.taclink, verdict)
        self.baseline: Use | None = None
        self.crashes_expected = False
        self.proxy = Proxy(self.server.socket)
        self.readers: list[FrameReader] = []
        self.clients: list[Any] = []
        self.quiet_clients: list[Any] = []

    def _write_inputs(self) -> None:
        (self.folder / "still.yaml").write_text(SCENE)
        (self.folder / "pressed.yaml").write_text(SCENE + PRESS)
        (self.folder / "arm.yaml").write_text(CONFIG.format(logs=self.logs, rate=RATE_HZ))
        for name in ("film", "tape"):
            command = [self.programs.taclink, "simulate", "--scene", "rest", "--out", self.folder / name]
            command += ["--frames", str(PAIRS)]
            subprocess.run([str(word) for word in command], check=True, capture_output=True)

    def _make_sample(self) -> None:
        """A log to play, by a first life."""
        self.start()
        until(lambda: sum(file.stat().st_size for file in self.logs.glob("*.part")) > SAMPLE_BYTES)
        self.end_life(signal.SIGTERM, "starting")
        for file in self.logs.glob("*.mcap"):  # the server's time zone is another one
            named = calendar.timegm(time.strptime(file.name.split("-")[-2], "%Y%m%dT%H%M%SZ"))
            if abs(named - time.time()) > 2 * PATIENCE_S:
                self.verdict.wrong(f"the name of {file.name} is not of its time, UTC")
        self.auditor.take_closed(self.server.life)

    def begin(self) -> None:
        self._make_sample()
        self.start()
        server, verdict = self.server, self.verdict
        self.ledger = FrameReader("every frame", server, verdict)
        slow = frame_pb2.DETAIL_FULL
        self.readers = [
            self.ledger,
            FrameReader("over the network", server, verdict, address=self.proxy.address),
            FrameReader("newest only", server, verdict, every=False),
            FrameReader("slow", server, verdict, detail=slow, pause_s=0.4),
        ]
        self.recorder = RecorderWatch(server, self.auditor)
        self.metrics = Metrics(server)
        self.watcher = WatchProcess(self.programs.taclink, server.address, self.folder)
        self.clients = [self.recorder, self.metrics, self.watcher, clients.contacts(self.proxy.address)]
        self.clients.append(clients.replay(server.address, verdict))
        self.quiet_clients = [clients.events(server.address, verdict)]  # there may be nothing to tell
        self.settle()

    def close(self) -> None:
        """Whatever state it is in; the processes end with it."""
        if self.server.lives():
            self.server.end(signal.SIGKILL, "the end of the run")
        for client in self.clients + self.quiet_clients:
            client.close()
        for reader in self.readers:
            reader.close()

    # The server's lives.

    def start(self) -> None:
        self.baseline = None
        self.auditor.note_logs(self.server.life)
        if not self.server.start():
            self.verdict.wrong(f"the server does not start: {self.server.log()[-2000:]}")
            raise SystemExit(1)

    def end_life(self, number: int, fault: str) -> None:
        if not self.server.lives():
            self.note_crash()
            return
        status = self.server.end(number, fault)
        expected = 0 if number == signal.SIGTERM else -number
        if status != expected:
            self.verdict.wrong(f"ended by {number}, the server's exit status is {status}: {self.server.log()[-2000:]}")

    def note_crash(self) -> None:
        status, life = self.server.exit_status(), self.server.life
        self.server.ended_by.setdefault(life, self.verdict.doing)
        if not (self.crashes_expected and status == -signal.SIGABRT):
            self.verdict.wrong(f"life {life} ended by itself, status {status}: {self.server.log()[-3000:]}")

    # What a fault does and what is awaited.

    def told(self, fault: str, condition: Callable[[], Any], what: str) -> None:
        """A fault must be told."""
        begun = time.monotonic()
        if until(condition, TOLD_WITHIN_S):
            self.verdict.told(fault, time.monotonic() - begun)
        else:
            self.verdict.wrong(f"not told within {TOLD_WITHIN_S:.0f} s: {what}")

    def settle(self) -> None:
        """Until all is well again; what is not by then is wrong."""
        if not self.server.lives():
            self.note_crash()
            self.start()
        crashed = self.watcher.revive()
        if crashed < 0 and crashed != -signal.SIGKILL:
            self.verdict.wrong(f"the watch process ended with signal {-crashed}")
        self.ledger.newest = {}
        syncs = self.auditor.syncs.syncs
        self._expect(self._links_measure, "all links measure again", self._link_states)
        self._expect(
            lambda: self.recorder.is_recording() and self.auditor.syncs.syncs >= syncs + 2,
            "the recorder records and syncs",
            lambda: str(self.recorder.status),
        )
        self._expect_clients()
        self._expect(
            lambda: not self.auditor.unfinished(self.server.life),
            "logs of earlier lives are made whole",
            lambda: str(self.auditor.unfinished(self.server.life)),
        )
        self.auditor.take_closed(self.server.life)
        self.audit_past_lives()
        self._check_use()

    def audit_past_lives(self) -> None:
        for life in range(1, self.server.life):
            fault = self.server.ended_by.get(life, "")
            self.auditor.audit(life, self.readers, fault, life not in self.server.ended_well)

    def _expect(self, condition: Callable[[], Any], what: str, state: Callable[[], str]) -> None:
        if not until(lambda: condition() or not self.server.lives()) or not self.server.lives():
            self.verdict.wrong(f"not within {PATIENCE_S:.0f} s: {what}; {state()}; {self.server.log()[-1000:]}")
            self.end_life(signal.SIGKILL, "what was wrong")  # so that the next faults can be judged
            self.start()

    def _links_measure(self) -> bool:
        newest = self.ledger.newest
        return all(
            name in newest and newest[name].status in MEASURES and newest[name].times.exposure_ns != 0
            for name in LINKS
        )

    def _link_states(self) -> str:
        return "; ".join(f"{name}: {f.status} {f.status_reason}" for name, f in self.ledger.newest.items())

    def _expect_clients(self) -> None:
        before = clients.all_progress(self.clients)
        frames = {reader.name: reader.frames for reader in self.readers}

        def waiting() -> list[str]:
            self.watcher.revive()
            out = [name for name, count in clients.all_progress(self.clients).items() if count == before[name]]
            return out + [reader.name for reader in self.readers if reader.frames == frames[reader.name]]

        self._expect(lambda: not waiting(), "every client goes on", lambda: f"but {waiting()}")

    def _check_use(self) -> None:
        if self.baseline is None:
            time.sleep(1)
            self.baseline = self.server.use()
            return
        baseline = self.baseline
        if not until(lambda: not self.server.use().over(baseline, SLACK), 60):
            over = ", ".join(self.server.use().over(baseline, SLACK))
            self.verdict.wrong(f"life {self.server.life} holds more than at its beginning: {over}")


def pick(rng: random.Random, low: float, high: float) -> float:
    return round(rng.uniform(low, high), 2)
