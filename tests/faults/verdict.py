"""What a run finds wrong, and what it was doing then."""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter

MOST_SHOWN = 40


class Verdict:
    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._lock = threading.Lock()
        self.doing = "starting"
        self.violations: Counter[str] = Counter()  # by what was done
        self.injected: Counter[str] = Counter()
        self.skipped: dict[str, str] = {}
        self.told_s: dict[str, float] = {}  # the longest until it was told

    def elapsed_s(self) -> float:
        return time.monotonic() - self._begun

    def do(self, what: str, note: str = "") -> None:
        self.doing = what
        self.say(f"{what} {note}".rstrip())

    def say(self, text: str) -> None:
        print(f"{self.elapsed_s():8.1f} s  {text}", flush=True)

    def wrong(self, what: str, about: str = "") -> None:
        """`about`: the fault that it belongs to, where it is another one than what is done now."""
        with self._lock:
            doing = about or self.doing
            self.violations[doing] += 1
            if sum(self.violations.values()) <= MOST_SHOWN:
                print(f"{self.elapsed_s():8.1f} s  WRONG ({doing}): {what}", file=sys.stderr, flush=True)

    def told(self, fault: str, seconds: float) -> None:
        self.told_s[fault] = max(self.told_s.get(fault, 0), seconds)

    def table(self) -> str:
        lines = [f"{'fault':28} {'times':>5} {'told after, s':>14} {'violations':>10}"]
        for name in sorted(set(self.injected) | set(self.violations)):
            told = f"{self.told_s[name]:.1f}" if name in self.told_s else "-"
            lines.append(f"{name:28} {self.injected[name]:5} {told:>14} {self.violations[name]:10}")
        lines += [f"{name:28} {'-':>5} skipped: {why}" for name, why in sorted(self.skipped.items())]
        return "\n".join(lines)
