"""Force thresholds and how links stand to them."""

from __future__ import annotations

from dataclasses import dataclass

from taclink.messages.arrays import alike
from taclink.names import ForceLevel, name_of
from taclink.v1 import events_pb2


@dataclass(frozen=True, kw_only=True, slots=True)
class Thresholds:
    """A level is entered at its threshold and left below it by the hysteresis."""

    warning_n: float  # 0: no such level
    alarm_n: float  # 0: no such level
    hysteresis_n: float


@dataclass(frozen=True, kw_only=True, slots=True)
class MarkerRange:
    """Rings and paths from 0, both ends included; first_path > last_path crosses path 0."""

    first_ring: int
    last_ring: int
    first_path: int
    last_path: int


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ForceLevelState:
    region: str  # empty: the whole link
    markers: MarkerRange | None  # of a region
    thresholds: Thresholds
    level: ForceLevel
    force_n: float  # of the strongest contact there


def thresholds_from(message: events_pb2.Thresholds) -> Thresholds:
    return alike(Thresholds, message)


def force_level_state_from(message: events_pb2.ForceLevelState) -> ForceLevelState:
    return alike(
        ForceLevelState,
        message,
        markers=alike(MarkerRange, message.markers) if message.HasField("markers") else None,
        thresholds=thresholds_from(message.thresholds),
        level=name_of(ForceLevel, message.level),
    )
