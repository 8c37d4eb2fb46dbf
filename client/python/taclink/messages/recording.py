"""The server's recordings, its logs and their replay. Times are ns since 1970-01-01 UTC."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Union

from taclink.messages.arm import Arm, arm_from
from taclink.messages.arrays import alike, optional
from taclink.messages.contacts import ArmContacts, arm_contacts_from
from taclink.messages.events import Event, event_from
from taclink.messages.frame import Frame, frame_from
from taclink.names import LossReason, RecorderState, name_of
from taclink.v1 import log_pb2, recording_pb2


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class RecorderStatus:
    state: RecorderState
    trouble: str  # what is wrong and what to do; empty: nothing
    last_trouble: str  # of this recording, also when it is over; empty: none
    last_trouble_utc_ns: int  # when it was told
    log: str  # that is being written, or was last
    started_utc_ns: int  # 0: nothing was recorded yet
    bytes: int  # of this recording, over all its logs
    logs: int
    frames: int
    events: int
    frames_lost: int  # published while it recorded but not in the logs
    pictures: bool
    synced_utc_ns: int  # what was written before is safe from a power cut
    folder: str  # on the server; empty: none is configured
    free_bytes: int
    quota_bytes: int  # the oldest logs are deleted to stay below; 0: never


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Log:
    name: str
    bytes: int
    start_utc_ns: int  # of the first message; 0: not known
    end_utc_ns: int
    links: tuple[str, ...]
    frames: int
    contacts: int | None  # that began; None: not known
    pictures: bool
    open: bool  # being written
    problem: str  # why it can be read only in part; empty: it is whole
    note: str


@dataclass(frozen=True, kw_only=True, slots=True)
class LogChannel:
    topic: str
    schema: str
    messages: int


@dataclass(frozen=True, kw_only=True, slots=True)
class LogAttachment:
    name: str
    media_type: str
    bytes: int


@dataclass(frozen=True, kw_only=True, slots=True)
class RecordingLoss:
    """Frames of a link that were published but are not in the log."""

    link: str
    count: int
    after_sequence: int  # of the frames around them; 0: there is none
    before_sequence: int
    reason: LossReason
    text: str  # for people
    utc_ns: int  # found missing


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class LogDescription:
    log: Log
    channels: tuple[LogChannel, ...]
    attachments: tuple[LogAttachment, ...]
    metadata: Mapping[str, str]  # by "NAME.KEY"
    losses: tuple[RecordingLoss, ...]
    arm: Arm  # as the log has it first


@dataclass(frozen=True, kw_only=True, slots=True)
class ReplayStatus:
    """Sent first, after each order, when the range begins again, once a second and last."""

    from_utc_ns: int  # of the range
    to_utc_ns: int
    position_utc_ns: int  # messages up to here were sent
    speed: float
    paused: bool
    ended: bool
    loops: int  # the range began again
    lateness_s: float  # latest that a message was sent, since the status before
    damaged: int  # places of the log that could not be read


ReplayContent = Union[ReplayStatus, Frame, ArmContacts, Event, Arm, RecordingLoss]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ReplayMessage:
    content: ReplayContent
    log_utc_ns: int  # of the message in the log; 0: a status


def recorder_from(message: recording_pb2.RecorderStatus) -> RecorderStatus:
    return alike(RecorderStatus, message, state=name_of(RecorderState, message.state))


def _log_from(message: recording_pb2.Log) -> Log:
    return alike(Log, message, links=tuple(message.links), contacts=optional(message, "contacts"))


def logs_from(message: recording_pb2.ListLogsResponse) -> tuple[Log, ...]:
    return tuple(map(_log_from, message.logs))


def _loss_from(message: log_pb2.RecordingLoss) -> RecordingLoss:
    return alike(RecordingLoss, message, reason=name_of(LossReason, message.reason))


def description_from(message: recording_pb2.DescribeLogResponse) -> LogDescription:
    return LogDescription(
        log=_log_from(message.log),
        channels=tuple(alike(LogChannel, each) for each in message.channels),
        attachments=tuple(alike(LogAttachment, each) for each in message.attachments),
        metadata=dict(message.metadata),
        losses=tuple(map(_loss_from, message.losses)),
        arm=arm_from(message.arm),
    )


def _status_from(message: recording_pb2.ReplayStatus) -> ReplayStatus:
    return alike(ReplayStatus, message)


_CONTENTS: dict[str, Callable[[Any], ReplayContent]] = {
    "status": _status_from,
    "frame": frame_from,
    "contacts": arm_contacts_from,
    "event": event_from,
    "arm": arm_from,
    "loss": _loss_from,
}


def replay_message_from(message: recording_pb2.ReplayResponse) -> ReplayMessage | None:
    """None: of a newer server."""
    kind = message.WhichOneof("message")
    if kind is None:
        return None
    return ReplayMessage(content=_CONTENTS[kind](getattr(message, kind)), log_utc_ns=message.log_utc_ns)
