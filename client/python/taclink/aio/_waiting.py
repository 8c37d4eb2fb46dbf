"""Connection, streams and writers that are awaited."""

from __future__ import annotations

import asyncio
import weakref
from collections import deque
from collections.abc import AsyncIterator, Callable
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
        self._metadata = settings.metadata
        if settings.credentials is None:
            self._channel = grpc.aio.insecure_channel(settings.address, settings.options)
        else:
            self._channel = grpc.aio.secure_channel(settings.address, settings.credentials, settings.options)
        self._stubs = stubs(self._channel)
        opened(self)

    def start(self, service: str, method: str, request: Any, timeout_s: float | None = None) -> Any:
        """The running call."""
        return getattr(self._stubs[service], method)(request, metadata=self._metadata, timeout=timeout_s)

    def start_writing(self, service: str, method: str) -> Any:
        return getattr(self._stubs[service], method)(metadata=self._metadata)

    async def close(self) -> None:
        await self._channel.close()
        closed(self)


class Connection(Owned):
    """Of one event loop: that in which it is first used."""

    def __init__(self, settings: Settings, timeout_s: float) -> None:
        self.address = settings.address
        self.timeout_s = timeout_s
        self.closed = False
        self._settings = settings
        self._channel: Channel | None = None
        self._streams: weakref.WeakSet[Stream[Any]] = weakref.WeakSet()

    def channel(self) -> Channel:
        self.own()
        if self.closed:
            raise errors.closed()
        if self._channel is None:
            self._channel = Channel(self._settings)
        return self._channel

    async def ask(self, call: Call[T]) -> T:
        timeout_s = self.timeout_s if call.timeout_s is None else call.timeout_s
        channel = self.channel()
        try:
            return call.result(await channel.start(call.service, call.method, call.request, timeout_s))
        except grpc.RpcError as error:
            raise self.failure(error, channel) from error

    def failure(self, error: Any, channel: Channel) -> errors.TaclinkError:
        # gRPC would not look for the server again for a while: the next call gets a fresh channel, which does.
        if errors.is_no_connection(error) and self._channel is channel:
            self._channel = None
        # Its frames hold the call, and that the old channel, which might connect later on for nobody.
        error.__traceback__ = None
        return errors.from_rpc(error, self.address)

    def hold(self, stream: Stream[Any]) -> None:
        """close() ends it; the channel would only find calls that a task reads without anything in between."""
        self._streams.add(stream)

    async def close(self) -> None:
        self.closed = True
        if self.is_inherited():
            return
        for stream in tuple(self._streams):
            await stream.close()
        if self._channel is not None:
            await self._channel.close()


async def outcome_of(call: Any) -> Any:
    """The next message, EOF, or the error in place of it, as a value.

    A read outlives the task that waits for it, and nobody may ever ask what became of it; an exception that it raised
    would then be printed by asyncio.run() as unhandled.
    """
    try:
        return await call.read()
    except (grpc.RpcError, asyncio.CancelledError) as error:
        return error


class Stream(StreamState[T], AsyncIterator[T]):
    """Messages of a server as they come: `async for`, in one task. Opened by the first message, or `async with`.

    A task that stops waiting for a message (asyncio.wait_for) does not end a stream that is open; close() does, the
    end of an `async with`, the client's close(), and leaving a loop over a stream that nobody else holds. Errors: as
    of the streams that block; what the server refuses with is raised by `async with`, or in place of the first message.
    """

    def __init__(
        self, connection: Connection, request: Any, timeout_s: float, attempts: Attempts | None = None
    ) -> None:
        self._request = request
        self._begin()
        self._connection = connection
        self._timeout_s = timeout_s
        self._attempts = attempts  # None: a broken stream ends
        self._closed = asyncio.Event()
        self._waiting: deque[T] = deque()  # read to see the server accept
        self._call: Any = None
        self._reading: asyncio.Future[Any] | None = None
        connection.hold(self)

    async def __anext__(self) -> T:
        self._connection.own()
        if self._call is None and not self._closed.is_set():
            await self._open_or_end()
        while not self._closed.is_set():
            item = self._waiting.popleft() if self._waiting else await self._read()
            if item is not None:
                if self._attempts is not None:
                    self._attempts.reset()
                return item
        raise StopAsyncIteration

    async def close(self) -> None:
        """From any task of the loop; an iteration that waits ends."""
        self._closed.set()
        self._cancel()

    async def __aenter__(self: S) -> S:
        if self._call is None:
            await self._open_or_end()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    def __del__(self) -> None:
        self._cancel()

    def _cancel(self) -> None:
        if getattr(self, "_call", None) is not None and not self._connection.is_inherited():
            self._call.cancel()

    async def _open_or_end(self) -> None:
        try:
            await self._open()
        except BaseException:
            self._closed.set()
            raise

    async def _open(self) -> None:
        self._end_reason = ""
        self._reading = None
        self._channel = self._connection.channel()
        call = self._channel.start(self._service, self._method, self._next_request())
        self._call = call
        if not self._answers_at_once:
            return
        try:
            message = await self._next_outcome(self._timeout_s)
        except asyncio.TimeoutError as error:
            call.cancel()
            raise errors.timed_out(self._connection.address) from error
        except asyncio.CancelledError:
            call.cancel()
            raise
        if isinstance(message, BaseException) and self._ended_here():
            raise errors.Cancelled("the stream was closed")
        if isinstance(message, grpc.RpcError):
            raise self._connection.failure(message, self._channel) from message
        if isinstance(message, BaseException):
            raise message
        if message is grpc.aio.EOF:
            raise errors.ended_by_server("it sent nothing", self._connection.address)
        item = self._take(message)
        if item is not None:
            self._waiting.append(item)

    def _ended_here(self) -> bool:
        return self._closed.is_set() or self._connection.closed

    async def _next_outcome(self, timeout_s: float | None = None) -> Any:
        """The read goes on when who waits for it is cancelled, or waits no longer (TimeoutError)."""
        if self._reading is None:
            self._reading = asyncio.ensure_future(outcome_of(self._call))
        reading = self._reading
        done, _ = await asyncio.wait((reading,), timeout=timeout_s)
        if not done:
            raise asyncio.TimeoutError
        self._reading = None
        return reading.result()

    async def _read(self) -> T | None:
        """None: nothing for the user, or the stream was opened again."""
        message = await self._next_outcome()
        if isinstance(message, BaseException):
            if self._ended_here():
                raise StopAsyncIteration
            if not isinstance(message, grpc.RpcError):
                raise message
            await self._recover(self._broken(message))
            return None
        if message is grpc.aio.EOF:
            self._closed.set()
            raise StopAsyncIteration
        return self._take(message)

    def _broken(self, error: Any) -> errors.TaclinkError:
        if self._end_reason:
            return errors.ended_by_server(self._end_reason, self._connection.address)
        failure = self._connection.failure(error, self._channel)
        failure.__cause__ = error
        return failure

    async def _recover(self, failure: errors.TaclinkError) -> None:
        """Returns once the stream is open again, or closed meanwhile."""
        try:
            while True:
                if self._attempts is None or not isinstance(failure, RETRIED):
                    raise failure
                delay_s = self._attempts.next_delay_s(failure)
                try:
                    await asyncio.wait_for(self._closed.wait(), delay_s)
                    return
                except asyncio.TimeoutError:
                    pass
                try:
                    return await self._open()
                except errors.TaclinkError as error:
                    if self._closed.is_set():
                        return
                    failure = error.with_traceback(None)
        except BaseException:
            self._closed.set()
            raise


class Writer(Generic[T]):
    """A stream to the server: write, then finish(); an `async with` finishes, or drops the call after an exception.

    Errors of both: why the server ended the call (InvalidArgument: which message and what is wrong). The server
    answers late: what is wrong with one message is told by a later write, or by finish().
    """

    def __init__(self, connection: Connection, method: str, result: Callable[[Any], T]) -> None:
        self._connection = connection
        self._method = method
        self._result = result
        self._summary: T | None = None
        self._call: Any = None

    @property
    def summary(self) -> T | None:
        """What the server made of it; None: not finished."""
        return self._summary

    async def finish(self) -> T:
        """Waits until the server has taken all. Errors: as of write."""
        if self._summary is None:
            call = self._started()
            try:
                await call.done_writing()
                self._summary = self._result(await asyncio.wait_for(call, self._connection.timeout_s))
            except asyncio.TimeoutError as error:
                raise errors.timed_out(self._connection.address) from error
            except grpc.RpcError as error:
                raise self._connection.failure(error, self._channel) from error
        return self._summary

    def cancel(self) -> None:
        """Drops the call; what the server has taken stays."""
        if self._call is not None and not self._connection.is_inherited():
            self._call.cancel()

    async def __aenter__(self: W) -> W:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            await self.finish()
        else:
            self.cancel()

    def _started(self) -> Any:
        self._connection.own()
        if self._call is None:
            self._channel = self._connection.channel()
            self._call = self._channel.start_writing("tactile", self._method)
        return self._call

    async def _write(self, request: Any) -> None:
        call = self._started()
        try:
            await call.write(request)
        except asyncio.InvalidStateError:
            # The call is over: finish says why.
            await self.finish()
            raise errors.Cancelled("this call was finished; begin another one") from None
        except grpc.RpcError as error:
            raise self._connection.failure(error, self._channel) from error
