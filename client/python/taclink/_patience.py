"""How long is waited where no timeout is given."""

from __future__ import annotations

import math
import os

from taclink.errors import InvalidArgument

VARIABLE = "TACLINK_PATIENCE_S"
CALL_S = 10.0
# Waits for frames, a new model or the disk; servers answer all else at once.
SLOW_S = 60.0

_MOST_S = 86_400.0  # far below what timers and gRPC can hold


def patience_s(usual_s: float) -> float:
    """`usual_s`, or what the environment variable TACLINK_PATIENCE_S says where that is more.

    Not set and empty are the same. More than a day counts as a day. Errors: InvalidArgument (not a positive number).
    """
    text = os.environ.get(VARIABLE, "")
    if not text:
        return usual_s
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not (math.isfinite(seconds) and seconds > 0):
        raise InvalidArgument(
            f"the environment variable {VARIABLE} is {text!r}, but must be a positive number of seconds, such as 60"
        )
    return max(usual_s, min(seconds, _MOST_S))


def chosen_s(timeout: float | None, usual_s: float) -> float:
    """A timeout that is given wins."""
    return patience_s(usual_s) if timeout is None else timeout
