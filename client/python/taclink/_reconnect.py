"""When a broken stream is tried again."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Optional

from taclink.errors import TaclinkError, Timeout, Unavailable

FIRST_DELAY_S = 0.25
LONGEST_DELAY_S = 2.0
RETRIED = (Unavailable, Timeout)

# The error that broke the stream or this try, the number of the try that follows, from 1, and the seconds until then.
OnReconnect = Optional[Callable[[TaclinkError, int, float], object]]


def delays_s() -> Iterator[float]:
    """Doubling, each shortened by up to a half so that many clients do not come back at the same moment."""
    delay_s = FIRST_DELAY_S
    while True:
        yield delay_s * random.uniform(0.5, 1)
        delay_s = min(2 * delay_s, LONGEST_DELAY_S)


class Attempts:
    """Tries since the stream last gave something."""

    def __init__(self, on_reconnect: OnReconnect) -> None:
        self._on_reconnect = on_reconnect
        self.reset()

    def reset(self) -> None:
        self._count = 0
        self._delays = delays_s()

    def next_delay_s(self, error: TaclinkError) -> float:
        """Tells the user, too."""
        self._count += 1
        delay_s = next(self._delays)
        if self._on_reconnect is not None:
            self._on_reconnect(error, self._count, delay_s)
        return delay_s


def attempts(reconnect: bool, on_reconnect: OnReconnect) -> Attempts | None:
    return Attempts(on_reconnect) if reconnect else None
