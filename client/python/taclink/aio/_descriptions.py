"""Descriptions are written once, at the client that blocks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

C = TypeVar("C", bound=type)


def described_by(original: type) -> Callable[[C], C]:
    """Gives what has no description that of what bears the same name in `original`."""

    def describe(kind: C) -> C:
        for name, method in vars(kind).items():
            if callable(method) and not method.__doc__:
                method.__doc__ = getattr(getattr(original, name, None), "__doc__", None)
        return kind

    return describe
