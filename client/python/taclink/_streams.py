"""What a stream has had until now, for both kinds of client: they only differ in how they wait."""

from __future__ import annotations

import time
from typing import Any, Generic, TypeVar

from taclink.messages.contacts import ArmContacts, arm_contacts_from
from taclink.messages.events import Event, EventPlace, event_from
from taclink.messages.frame import Frame, StreamCounts, counts_from, frame_from, latency_of
from taclink.messages.others import Preview, preview_from
from taclink.messages.recording import ReplayMessage, ReplayStatus, replay_message_from
from taclink.v1 import frame_pb2, tactile_pb2

T = TypeVar("T")


class StreamState(Generic[T]):
    _service = "tactile"
    _method = ""
    # The first message comes at once, so that a refusal is told before anything is waited for.
    _answers_at_once = True

    _request: Any
    _end_reason = ""

    def _begin(self) -> None:
        """Before the first message."""

    def _next_request(self) -> Any:
        """Of the first call, or after a break."""
        return self._request

    def _take(self, message: Any) -> T | None:
        """What the user gets of it; None: nothing."""
        raise NotImplementedError


class FrameState(StreamState[Frame]):
    _method = "StreamFrames"
    _max_age_s: float | None = None

    def _begin(self) -> None:
        self._too_old: dict[str, int] = {}
        self._counts: tuple[StreamCounts, ...] = ()
        self._queue_capacity = 0
        self._last: dict[str, int] = {}

    @property
    def counts(self) -> tuple[StreamCounts, ...]:
        """As the server last told them: at the start, and at most once a second when frames were dropped."""
        return self._counts

    @property
    def queue_capacity(self) -> int:
        """Frames that can wait on the server for this client."""
        return self._queue_capacity

    @property
    def too_old(self) -> dict[str, int]:
        """By link: frames that were older than max_age_s when they came here, and so were left out."""
        return dict(self._too_old)

    def _take(self, message: tactile_pb2.StreamFramesResponse) -> Frame | None:
        kind = message.WhichOneof("message")
        if kind == "status":
            self._counts = counts_from(message.status)
            self._queue_capacity = message.status.queue_capacity
            self._end_reason = message.status.end_reason
        if kind != "frame":
            return None
        now_utc_ns = time.time_ns()
        frame = message.frame
        if self._is_too_old(frame, now_utc_ns):
            self._too_old[frame.link] = self._too_old.get(frame.link, 0) + 1
            return None
        last = self._last.get(frame.link)
        self._last[frame.link] = frame.sequence
        gap = None if last is None or frame.sequence < last else max(frame.sequence - last - 1, 0)
        return frame_from(frame, now_utc_ns, gap)

    def _is_too_old(self, frame: frame_pb2.LinkFrame, now_utc_ns: int) -> bool:
        latency_s = latency_of(frame.times.exposure_utc_ns, now_utc_ns, frame.replayed)
        return self._max_age_s is not None and latency_s is not None and latency_s > self._max_age_s


class ContactState(StreamState[ArmContacts]):
    _method = "StreamContacts"

    def _take(self, message: Any) -> ArmContacts:
        return arm_contacts_from(message, time.time_ns())


class EventState(StreamState[Event]):
    _method = "StreamEvents"

    def _begin(self) -> None:
        self._place: EventPlace | None = None
        self._events_lost = 0
        self._run_changed = False
        self._newest_sequence = 0

    @property
    def place(self) -> EventPlace | None:
        """Where to go on with events(after=...); moves on each second, also without events. None: not known yet."""
        return self._place

    @property
    def events_lost(self) -> int:
        """Events that had left the server's history before they could be sent, since the stream was last opened."""
        return self._events_lost

    @property
    def run_changed(self) -> bool:
        """The server was started again: what happened at the end of its former run is unknown."""
        return self._run_changed

    @property
    def newest_sequence(self) -> int:
        """Of all events of the server."""
        return self._newest_sequence

    def _next_request(self) -> Any:
        if self._place is not None:
            self._request.run_id = self._place.run_id
            self._request.after_sequence = self._place.after_sequence
        return self._request

    def _take(self, message: Any) -> Event | None:
        kind = message.WhichOneof("message")
        if kind == "status":
            status = message.status
            self._place = EventPlace(run_id=status.run_id, after_sequence=status.position)
            self._events_lost = status.events_lost
            self._run_changed = status.run_changed
            self._newest_sequence = status.newest_sequence
            self._end_reason = status.end_reason
        if kind != "event":
            return None
        event = event_from(message.event, time.time_ns())
        run_id = self._place.run_id if self._place else ""
        self._place = EventPlace(run_id=run_id, after_sequence=event.sequence)
        return event


class PreviewState(StreamState[Preview]):
    _method = "StreamPreview"
    _answers_at_once = False  # with the next picture, which may not come

    def _take(self, message: Any) -> Preview:
        return preview_from(message)


class ReplayState(StreamState[ReplayMessage]):
    _service = "recording"
    _method = "Replay"

    def _begin(self) -> None:
        self._player = ""
        self._status: ReplayStatus | None = None

    @property
    def status(self) -> ReplayStatus | None:
        """The newest that was read; None: not opened yet."""
        return self._status

    def _take(self, message: Any) -> ReplayMessage | None:
        if message.WhichOneof("message") == "status":
            self._player = message.status.player
        out = replay_message_from(message)
        if out is not None and isinstance(out.content, ReplayStatus):
            self._status = out.content
        return out
