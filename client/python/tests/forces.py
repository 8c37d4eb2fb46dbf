"""The force of the scene `press` in the text that programs print."""

from __future__ import annotations

import pytest

IN_TEXT = r"(\d+\.\d\d) N"
# The 10 % that the other tests allow the estimated force, and half of the last printed digit.
PRESS_N = pytest.approx(0.2, abs=0.2 * 0.1 + 0.005)
