"""Connection, streams and writers that block."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import grpc

from taclink import errors
from taclink._calls import Call
from taclink._channel import Settings, stubs
from taclink._process import Owned, closed, opened
from taclink._reconnect import RETRIED, Attempts
from taclink._streams import StreamState

T = TypeVar("T")
S = TypeVar("S", bound="Stream[Any]")
W = TypeVar("W", bound="Writer[Any]")


class Channel:
    """One connection to the server."""

    def __init__(self, settings: Settings) -> None:
        self._address = settings.address
        self._metadata = settings.metadata
        if settings.credentials is None:
            self._channel = grpc.insecure_channel(settings.address, settings.options)
        else:
            self._channel = grpc.secure_channel(settings.address, settings.credentials, settings.options)
        self._stubs = stubs(self._channel)
        opened(self)

    def start(self, service: str, method: str, request: Any, timeout_s: float | None = None) -> Any:
        """The running call, of which messages are read."""
        return self._start(getattr(self._stubs[service], method), request, timeout_s)

    def start_future(self, service: str, method: str, request: Any, timeout_s: float | None = None) -> Any:
        """The running call, of which one answer is awaited; of a stream to the server, `request` is an iterator."""
        return self._start(getattr(self._stubs[service], method).future, request, timeout_s)

    def close(self) -> None:
        self._channel.close()
        closed(self)

    def _start(self, start: Any, request: Any, timeout_s: float | None) -> Any:
        try:
            return start(request, metadata=self._metadata, timeout=timeout_s)
        except ValueError as error:  # closed by another thread just now
            raise errors.lost(str(error), self._address) from error


class Connection(Owned):
    def __init__(self, settings: Settings, timeout_s: float) -> None:
        self.address = settings.address
        self.timeout_s = timeout_s
        self.closed = False
        self._settings = settings
        self._lock = threading.Lock()
        self._channel: Channel | None = None

    def channel(self) -> Channel:
        self.own()  # before the lock, which another thread of the parent may have held
        with self._lock:
            if self.closed:
                raise errors.closed()
            if self._channel is None:
                self._channel = Channel(self._settings)
            return self._channel

    def ask(self, call: Call[T]) -> T:
        timeout_s = self.timeout_s if call.timeout_s is None else call.timeout_s
        channel = self.channel()
        # Not the stub's blocking call, which leaks memory with each channel that finds no server.
        future = channel.start_future(call.service, call.method, call.request, timeout_s)
        try:
            return call.result(future.result())
        except grpc.RpcError as error:
            raise self.failure(error, channel) from error
        except grpc.FutureCancelledError as error:
            raise self._cancelled(str(error)) from error
        finally:
            future.cancel()

    def failure(self, error: Any, channel: Channel) -> errors.TaclinkError:
        # gRPC would not look for the server again for a while: the next call gets a fresh channel, which does. The
        # old one is closed, or it might connect later on for nobody.
        if errors.is_no_connection(error):
            with self._lock:
                if self._channel is channel:
                    self._channel = None
            channel.close()
        failure = errors.from_rpc(error, self.address)
        return self._cancelled(failure.details) if isinstance(failure, errors.Cancelled) else failure

    def _cancelled(self, details: str) -> errors.TaclinkError:
        """With its channel, by another thread."""
        return errors.closed() if self.closed else errors.lost(details, self.address)

    def close(self) -> None:
        if self.is_inherited():
            self.closed = True
            return
        with self._lock:
            self.closed = True
            channel, self._channel = self._channel, None
        if channel is not None:
            channel.close()


class Stream(StreamState[T], Iterator[T]):
    """Messages of a server as they come: iterate over it, in one thread.

    Ends on the server with close(), at the end of a `with`, or when nobody holds it any more; so a loop over
    `client.frames()` that is left ends it too. Errors while iterating: Unavailable (the server ended the
    stream, with its reason, or is gone), and after a reconnection whatever the server then refuses with.
    """

    def __init__(
        self, connection: Connection, request: Any, timeout_s: float, attempts: Attempts | None = None
    ) -> None:
        self._request = request
        self._begin()
        self._connection = connection
        self._timeout_s = timeout_s
        self._attempts = attempts  # None: a broken stream ends
        self._closed = threading.Event()
        self._waiting: deque[T] = deque()  # read to see the server accept
        self._call: Any = None
        self._open()

    def __next__(self) -> T:
        self._connection.own()
        while not self._closed.is_set():
            item = self._waiting.popleft() if self._waiting else self._read()
            if item is not None:
                if self._attempts is not None:
                    self._attempts.reset()
                return item
        raise StopIteration

    def close(self) -> None:
        """From any thread; an iteration that waits ends."""
        self._closed.set()
        self._cancel()

    def __enter__(self: S) -> S:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self._cancel()

    def _cancel(self) -> None:
        if getattr(self, "_call", None) is not None and not self._connection.is_inherited():
            self._call.cancel()

    def _open(self) -> None:
        self._end_reason = ""
        self._channel = self._connection.channel()
        call = self._channel.start(self._service, self._method, self._next_request())
        self._call = call
        if self._closed.is_set():
            call.cancel()
        if not self._answers_at_once:
            return
        late = threading.Event()

        def give_up() -> None:
            late.set()
            call.cancel()

        timer = threading.Timer(self._timeout_s, give_up)
        timer.daemon = True
        timer.start()
        try:
            item = self._take(next(call))
        except (grpc.RpcError, StopIteration) as error:
            raise self._opening_failed(error, late.is_set()) from error
        finally:
            timer.cancel()
        if item is not None:
            self._waiting.append(item)

    def _opening_failed(self, error: Any, late: bool) -> errors.TaclinkError:
        if late:
            return errors.timed_out(self._connection.address)
        if isinstance(error, StopIteration):
            return errors.ended_by_server("it sent nothing", self._connection.address)
        return self._connection.failure(error, self._channel)

    def _read(self) -> T | None:
        """None: nothing for the user, or the stream was opened again."""
        try:
            return self._take(next(self._call))
        except StopIteration:
            self._closed.set()
            raise
        except grpc.RpcError as error:
            if self._closed.is_set() or self._connection.closed:
                raise StopIteration from None
            self._recover(self._broken(error))
            return None

    def _broken(self, error: Any) -> errors.TaclinkError:
        if self._end_reason:
            return errors.ended_by_server(self._end_reason, self._connection.address)
        failure = self._connection.failure(error, self._channel)
        failure.__cause__ = error
        return failure

    def _recover(self, failure: errors.TaclinkError) -> None:
        """Returns once the stream is open again."""
        try:
            while True:
                if self._attempts is None or not isinstance(failure, RETRIED):
                    raise failure
                if self._closed.wait(self._attempts.next_delay_s(failure)):
                    raise StopIteration
                try:
                    return self._open()
                except errors.TaclinkError as error:
                    failure = error
        except BaseException:
            self._closed.set()
            raise


class Feed(Iterator[Any]):
    """Requests on their way to gRPC's own thread; bounded, so that who writes waits while the server is behind."""

    _BOUND = 16

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._requests: deque[Any] = deque()
        self._closed = False

    def put(self, request: Any) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._closed or len(self._requests) < self._BOUND)
            self._requests.append(request)
            self._changed.notify_all()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def __next__(self) -> Any:
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._requests)
            if not self._requests:
                raise StopIteration
            self._changed.notify_all()
            return self._requests.popleft()


class Writer(Generic[T]):
    """A stream to the server: write, then finish(); a `with` finishes, or drops the call after an exception.

    Errors of both: why the server ended the call (InvalidArgument: which message and what is wrong). The server
    answers late: what is wrong with one message is told by a later write, or by finish().
    """

    def __init__(self, connection: Connection, method: str, result: Callable[[Any], T]) -> None:
        self._connection = connection
        self._result = result
        self._feed = Feed()
        self._summary: T | None = None
        self._channel = connection.channel()
        self._call = self._channel.start_future("tactile", method, self._feed)
        feed = self._feed
        self._call.add_done_callback(lambda _: feed.close())  # wakes a write that waits

    @property
    def summary(self) -> T | None:
        """What the server made of it; None: not finished."""
        return self._summary

    def finish(self) -> T:
        """Waits until the server has taken all. Errors: as of write."""
        self._connection.own()
        if self._summary is None:
            self._feed.close()
            try:
                self._summary = self._result(self._call.result(timeout=self._connection.timeout_s))
            except grpc.FutureTimeoutError as error:
                self._call.cancel()
                raise errors.timed_out(self._connection.address) from error
            except grpc.FutureCancelledError as error:
                raise errors.Cancelled("the call was cancelled") from error
            except grpc.RpcError as error:
                raise self._connection.failure(error, self._channel) from error
        return self._summary

    def cancel(self) -> None:
        """Drops the call; what the server has taken stays."""
        if self._connection.is_inherited():
            return
        self._call.cancel()
        self._feed.close()

    def __enter__(self: W) -> W:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.finish()
        else:
            self.cancel()

    def __del__(self) -> None:
        if hasattr(self, "_call"):
            self.cancel()

    def _write(self, request: Any) -> None:
        self._connection.own()
        self._feed.put(request)
        if self._call.done():
            self.finish()
            raise errors.Cancelled("this call was finished; begin another one")
