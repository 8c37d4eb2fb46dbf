"""How the enums of the protocol become Python's; taclink/names.py, which setup.py generates, has them."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from functools import lru_cache
from typing import Any, TypeVar

from taclink.errors import InvalidArgument


class Name(str, Enum):
    """Members stand in the order of the protocol's numbers, from 0."""

    def __str__(self) -> str:
        return str(self.value)


N = TypeVar("N", bound=Name)


@lru_cache(maxsize=None)
def _members(kind: type[N]) -> Sequence[N]:
    return tuple(kind)


def name_of(kind: type[N], number: int) -> N:
    """The first member stands also for what a newer server says."""
    members = _members(kind)
    return members[number] if 0 <= number < len(members) else members[0]


def number_of(kind: type[N], text: str, what: str) -> Any:
    """As the protocol has it. Errors: InvalidArgument, with the names that there are."""
    known = {
        member.value: number
        for number, member in enumerate(_members(kind))
        if member.value != "unknown" or number > 0
    }
    if text in known:
        return known[text]
    choices = ", ".join(known)
    raise InvalidArgument(f"{what} must be one of {choices}, not '{text}'")
