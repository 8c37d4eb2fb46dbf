"""Arrays and plain fields of the protocol's messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
ByteArray = npt.NDArray[np.uint8]
D = TypeVar("D")

# Place of each element of a 3 x 3 matrix in xx, xy, xz, yy, yz, zz.
_SYMMETRIC = [0, 1, 2, 1, 3, 4, 2, 4, 5]


def _frozen(array: Any) -> Any:
    array.setflags(write=False)
    return array


def numbers(values: Sequence[float]) -> FloatArray:
    array: FloatArray = _frozen(np.fromiter(values, np.float64, len(values)))
    return array


def whole_numbers(values: Sequence[int]) -> IntArray:
    array: IntArray = _frozen(np.fromiter(values, np.int64, len(values)))
    return array


def small_numbers(values: Sequence[int]) -> ByteArray:
    array: ByteArray = _frozen(np.fromiter(values, np.uint8, len(values)))
    return array


def rows(values: Sequence[float], width: int) -> FloatArray:
    """Shape (n, width)."""
    return numbers(values).reshape(-1, width)


def vector(message: Any) -> FloatArray:
    """Shape (3,); of a Vector3."""
    return numbers((message.x, message.y, message.z))


def unknown_vector() -> FloatArray:
    """Shape (3,); NaN."""
    return numbers((np.nan, np.nan, np.nan))


def covariances(values: Sequence[float]) -> FloatArray:
    """Shape (n, 3, 3); of upper triangles, row by row."""
    array: FloatArray = _frozen(rows(values, 6)[:, _SYMMETRIC].reshape(-1, 3, 3))
    return array


def covariance(values: Sequence[float]) -> FloatArray | None:
    """Shape (3, 3); None: not known."""
    return covariances(values)[0] if len(values) == 6 else None


@lru_cache(maxsize=None)
def _field_names(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def alike(kind: type[D], message: Any, /, **others: Any) -> D:
    """A dataclass of the message's fields of the same names, but for the `others`."""
    hashable: Any = kind
    names = _field_names(hashable)
    return kind(**{name: getattr(message, name) for name in names if name not in others}, **others)


def optional(message: Any, field: str) -> Any:
    """None: absent."""
    return getattr(message, field) if message.HasField(field) else None
