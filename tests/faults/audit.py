"""Holds what clients had, and what was recorded, against what is in the logs."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from frame_readers import FrameReader, missed
from mcap_log import LogContent, read_log
from verdict import Verdict

PART = ".part"
SAMPLE = "sample.mcap"  # stays, for replays
HAND_OVER_S = 1.0  # at most, from a frame at a client to the recorder's file


@dataclass
class LifeLogs:
    frames: dict[str, Counter[int]] = field(default_factory=dict)
    losses: list[tuple[str, int, int, int]] = field(default_factory=list)  # link, after, before, count
    frames_lost: int = 0  # of all its logs, as the last one's totals tell
    logs: int = 0


class SyncWatch:
    """From when on a server's frames are not known to be safe; by what it tells of its recording, without its clock.

    A sync that was seen to end in a poll began after the one before had ended: what was published before the poll that
    did not show that one yet is in it.
    """

    def __init__(self) -> None:
        self._life = self._synced = 0
        self._asked_at = 0.0
        self._first_ended_after = 0.0
        self.safe_until: dict[int, float] = {}
        self.syncs = 0

    def take(self, life: int, asked_at: float, synced_utc_ns: int) -> None:
        if life != self._life:
            self._life, self._synced, self._asked_at, self._first_ended_after = life, synced_utc_ns, asked_at, 0.0
            return
        if synced_utc_ns != self._synced:
            self.syncs += 1
            if self._first_ended_after > 0:
                self.safe_until[life] = self._first_ended_after - HAND_OVER_S
            self._first_ended_after = self._asked_at
            self._synced = synced_utc_ns
        self._asked_at = asked_at


class Auditor:
    def __init__(self, logs: Path, program: Path, verdict: Verdict) -> None:
        self.folder, self._program, self._verdict = logs, program, verdict
        self.syncs = SyncWatch()
        self._sample = logs.parent / SAMPLE
        self._life_of: dict[str, int] = {}  # of logs that are not read yet
        self._lives: dict[int, LifeLogs] = {}
        self._audited: set[int] = set()
        self.frames_checked = self.logs_checked = 0

    def logs_of(self, life: int) -> LifeLogs:
        return self._lives.setdefault(life, LifeLogs())

    def note_logs(self, life: int) -> None:
        """What is in the folder and was not there in an earlier life is of this one; names may come again.

        Unfinished ones first: they get their final names meanwhile.
        """
        files = self._files("*.mcap" + PART) + self._files("*.mcap")
        names = {file.name.removesuffix(PART) for file in files}
        self._life_of = {name: self._life_of.get(name, life) for name in names}

    def unfinished(self, before_life: int) -> list[Path]:
        """Logs of earlier lives that nobody has made whole."""
        names = {name for name, life in self._life_of.items() if life < before_life}
        return [file for file in self._files("*.mcap" + PART) if file.name.removesuffix(PART) in names]

    def take_closed(self, life: int) -> None:
        """Reads and checks logs that are closed, and deletes them."""
        self.note_logs(life)
        for file in self._files("*.mcap"):
            self.take_log(file, self._life_of.pop(file.name, life))
        self.keep_sample()

    def take_log(self, file: Path, life: int) -> None:
        logs = self.logs_of(life)
        try:
            content = read_log(file, self._program)
        except (ValueError, OSError, subprocess.CalledProcessError) as error:
            self._verdict.wrong(f"{file.name} of life {life} can't be read: {error}")
            return
        self._check(file, life, content)
        logs.logs += 1
        self.logs_checked += 1
        for link, sequences in content.frames.items():
            logs.frames.setdefault(link, Counter()).update(sequences)
        for loss in content.losses:
            logs.losses.append((loss.link, loss.after_sequence, loss.before_sequence, loss.count))
        logs.frames_lost = max(logs.frames_lost, int(content.totals.get("frames_lost", 0)))
        if not self._sample.exists() and content.frame_messages > 20:
            shutil.copy(file, self._sample)
        file.unlink()

    def keep_sample(self) -> None:
        """A log for those who play one; folders come and go."""
        if self._sample.exists() and self.folder.is_dir() and not (self.folder / SAMPLE).exists():
            shutil.copy(self._sample, self.folder / SAMPLE)

    def _check(self, file: Path, life: int, content: LogContent) -> None:
        check = subprocess.run(
            [str(self._program), "log", "check", str(file)], capture_output=True, text=True, check=False
        )
        if check.returncode != 0:
            self._verdict.wrong(f"{file.name} of life {life} is not whole: {check.stdout}{check.stderr}")
        told = content.totals.get("frames")
        if told is not None and int(told) != content.frame_messages:
            self._verdict.wrong(
                f"{file.name} of life {life} has {content.frame_messages} frames and tells {told}"
            )

    def audit(self, life: int, readers: list[FrameReader], fault: str, was_killed: bool) -> None:
        """A life that is over, and whose logs are read. `fault` ended it."""
        if life in self._audited:
            return
        self._audited.add(life)
        logs = self.logs_of(life)
        for link, sequences in logs.frames.items():
            twice = [sequence for sequence, count in sequences.items() if count > 1]
            if twice:
                self._verdict.wrong(f"life {life}: frames of {link} are in the logs twice: {twice[:5]}", fault)
        lost = sum(count for _, _, _, count in logs.losses)
        if not was_killed and lost != logs.frames_lost:
            self._verdict.wrong(f"life {life}: {logs.frames_lost} frames were lost, {lost} are named", fault)
        for reader in readers:
            self._audit_reader(life, reader, fault, was_killed)

    def _audit_reader(self, life: int, reader: FrameReader, fault: str, was_killed: bool) -> None:
        logs = self.logs_of(life)
        safe_until = self.syncs.safe_until.get(life, 0.0) if was_killed else time.monotonic()
        for stream in (stream for stream in reader.streams if stream.life == life):
            for link, received in stream.received.items():
                recorded = logs.frames.get(link, Counter())
                gone = [s for s, at in received.items() if at < safe_until and s not in recorded]
                gone = [s for s in gone if not self._is_told(logs, link, s)]
                self.frames_checked += len(received)
                if gone:
                    self._verdict.wrong(
                        f"life {life}: {len(gone)} frames of {link} that client '{reader.name}' had are in no log"
                        f" and not told as lost: {gone[:5]} (it had {min(received)} to {max(received)})",
                        fault,
                    )
                missing = missed(stream, link, set(recorded))
                if len(missing) > stream.dropped.get(link, 0):
                    self._verdict.wrong(
                        f"life {life}: client '{reader.name}' missed {len(missing)} frames of {link},"
                        f" {stream.dropped.get(link, 0)} were told: {missing[:5]}",
                        fault,
                    )

    @staticmethod
    def _is_told(logs: LifeLogs, link: str, sequence: int) -> bool:
        return any(
            name == link and (after == 0 or after < sequence) and (before == 0 or sequence < before)
            for name, after, before, _ in logs.losses
        )

    def _files(self, pattern: str) -> list[Path]:
        return sorted(file for file in self.folder.glob(pattern) if file.name != SAMPLE)
