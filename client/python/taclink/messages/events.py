"""What happens to the links."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Union

from taclink.messages.arrays import FloatArray, alike, vector
from taclink.messages.force_level import Thresholds, thresholds_from
from taclink.names import EventKind, ForceLevel, LinkStatus, Reason, name_of
from taclink.v1 import events_pb2


@dataclass(frozen=True, kw_only=True, slots=True)
class EventPlace:
    """A place in the events of a server's run, to go on after. EventPlace(): all that the server still has."""

    run_id: str = ""
    after_sequence: int = 0


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ContactEvent:
    """A contact began, changed or ended; link frame."""

    contact_id: int  # Contact.id in the frame that began it
    center_m: FloatArray  # (3,)
    normal: FloatArray  # (3,), unit, away from the axis
    force_n: FloatArray  # (3,), what the world exerts on the skin; of an end: when it was last there
    normal_force_n: float  # pressing in is positive
    peak_force_n: float
    duration_s: float
    end_reason: str  # "released" or "new baseline"; empty: it goes on


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ForceLevelEvent:
    """A threshold was crossed, up or down."""

    region: str  # empty: the whole link
    level: ForceLevel
    previous: ForceLevel
    force_n: float  # of the strongest contact there
    thresholds: Thresholds
    contact_id: int  # 0: none is left
    center_m: FloatArray  # (3,), of that contact, link frame


@dataclass(frozen=True, kw_only=True, slots=True)
class LinkStatusEvent:
    status: LinkStatus
    previous: LinkStatus
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class OperationEvent:
    """Something was asked of a link."""

    who: str
    accepted: bool
    outcome: str  # for people: why it was refused, or what was done
    values: Mapping[str, float]  # SI units, named in the keys: "shift_m", ...


@dataclass(frozen=True, kw_only=True, slots=True)
class DriftEvent:
    drift_m: float  # since the baseline was taken
    step_m: float  # since the event before


@dataclass(frozen=True, kw_only=True, slots=True)
class FramesLostEvent:
    frames: int  # of this link, since the event before


EventDetail = Union[
    ContactEvent, ForceLevelEvent, LinkStatusEvent, OperationEvent, DriftEvent, FramesLostEvent, None
]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Event:
    """Times in ns; 0: no frame made it. utc: since 1970-01-01; all else: the server's CLOCK_MONOTONIC."""

    sequence: int  # in this run of the server
    kind: EventKind
    link: str  # empty: the whole arm
    frame_sequence: int  # Frame.sequence; 0: no frame made it
    frame_status: LinkStatus | None  # of that frame; None: no frame made it
    frame_reasons: tuple[Reason, ...]  # what made that frame worse than it could be, the gravest first
    exposure_utc_ns: int
    exposure_ns: int
    published_ns: int
    raised_ns: int
    raised_utc_ns: int
    sent_utc_ns: int
    client_utc_ns: int  # this client had it; 0: it comes from a log
    detail: EventDetail  # by the kind; None: of a newer server

    @property
    def latency_s(self) -> float | None:
        """From the exposure of the frame that made it to this client; None: not known."""
        if self.exposure_utc_ns == 0 or self.client_utc_ns == 0:
            return None
        return (self.client_utc_ns - self.exposure_utc_ns) * 1e-9


def _contact_from(message: events_pb2.ContactEvent) -> ContactEvent:
    return alike(
        ContactEvent,
        message,
        center_m=vector(message.center_m),
        normal=vector(message.normal),
        force_n=vector(message.force_n),
    )


def _force_level_from(message: events_pb2.ForceLevelEvent) -> ForceLevelEvent:
    return alike(
        ForceLevelEvent,
        message,
        level=name_of(ForceLevel, message.level),
        previous=name_of(ForceLevel, message.previous),
        thresholds=thresholds_from(message.thresholds),
        center_m=vector(message.center_m),
    )


def _link_status_from(message: events_pb2.LinkStatusEvent) -> LinkStatusEvent:
    return alike(
        LinkStatusEvent,
        message,
        status=name_of(LinkStatus, message.status),
        previous=name_of(LinkStatus, message.previous),
    )


def _operation_from(message: events_pb2.OperationEvent) -> OperationEvent:
    return alike(OperationEvent, message, values=dict(message.values))


def _drift_from(message: events_pb2.DriftEvent) -> DriftEvent:
    return alike(DriftEvent, message)


def _frames_lost_from(message: events_pb2.FramesLostEvent) -> FramesLostEvent:
    return alike(FramesLostEvent, message)


_DETAILS: dict[str, Callable[[Any], EventDetail]] = {
    "contact": _contact_from,
    "force_level": _force_level_from,
    "link_status": _link_status_from,
    "operation": _operation_from,
    "drift": _drift_from,
    "frames_lost": _frames_lost_from,
}


def event_from(message: events_pb2.Event, client_utc_ns: int = 0) -> Event:
    times = message.times
    detail = message.WhichOneof("detail")
    return Event(
        sequence=message.sequence,
        kind=name_of(EventKind, message.kind),
        link=message.link,
        frame_sequence=message.frame_sequence,
        frame_status=name_of(LinkStatus, message.frame_status) if message.frame_status else None,
        frame_reasons=tuple(name_of(Reason, reason) for reason in message.frame_reasons),
        exposure_utc_ns=times.exposure_utc_ns,
        exposure_ns=times.exposure_ns,
        published_ns=times.published_ns,
        raised_ns=times.raised_ns,
        raised_utc_ns=times.raised_utc_ns,
        sent_utc_ns=times.sent_utc_ns,
        client_utc_ns=client_utc_ns,
        detail=_DETAILS[detail](getattr(message, detail)) if detail else None,
    )
