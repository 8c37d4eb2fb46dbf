"""What can go wrong, and the one place that makes it of gRPC's errors."""

from __future__ import annotations

from typing import Any

import grpc


class TaclinkError(Exception):
    """Any failure of a call to a server; str() of it says what to do.

    `details` is what the server or gRPC said, `address` the server's.
    """

    def __init__(self, message: str, *, details: str = "", address: str = "") -> None:
        super().__init__(message)
        self.details = details
        self.address = address


class InvalidArgument(TaclinkError):
    """The request makes no sense: the message says which part and what is expected."""


class NotFound(TaclinkError):
    """No such link, region, log, player or file."""


class Refused(TaclinkError):
    """Not in this state: the skin is touched, a recording is under way, a log is played, ..."""


class OutOfRange(TaclinkError):
    """Past the end, of a log for example."""


class Unavailable(TaclinkError):
    """No server there, the connection broke, or the server ended the call. Worth another try."""


class Timeout(TaclinkError):
    """No answer in time."""


class ResourceExhausted(TaclinkError):
    """A limit of the server is reached: the message says which."""


class Unauthenticated(TaclinkError):
    """The server asks for a token, or does not know this one."""


class PermissionDenied(TaclinkError):
    """The token's role does not allow this."""


class Unsupported(TaclinkError):
    """The server, or the link's camera, does not offer this."""


class DataLoss(TaclinkError):
    """A log is damaged beyond reading."""


class Cancelled(TaclinkError):
    """The call was ended from this side."""


class WrongProcess(TaclinkError):
    """A process that was forked uses what its parent has, or gRPC, which its parent has used."""


class Internal(TaclinkError):
    """Anything else; most likely a defect."""


_KINDS: dict[Any, type[TaclinkError]] = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidArgument,
    grpc.StatusCode.NOT_FOUND: NotFound,
    grpc.StatusCode.FAILED_PRECONDITION: Refused,
    grpc.StatusCode.OUT_OF_RANGE: OutOfRange,
    grpc.StatusCode.UNAVAILABLE: Unavailable,
    grpc.StatusCode.DEADLINE_EXCEEDED: Timeout,
    grpc.StatusCode.RESOURCE_EXHAUSTED: ResourceExhausted,
    grpc.StatusCode.UNAUTHENTICATED: Unauthenticated,
    grpc.StatusCode.PERMISSION_DENIED: PermissionDenied,
    grpc.StatusCode.UNIMPLEMENTED: Unsupported,
    grpc.StatusCode.DATA_LOSS: DataLoss,
    grpc.StatusCode.CANCELLED: Cancelled,
}
# What gRPC itself says where nothing listens or TLS fails.
_NO_CONNECTION = ("failed to connect to all addresses", "DNS resolution failed", "Name or service not known")

_NOT_TRUSTED = ("certificate verify failed", "peer certificate")


def is_no_connection(error: Any) -> bool:
    """No server was reached at all; of a grpc.RpcError."""
    return error.code() is grpc.StatusCode.UNAVAILABLE and (error.details() or "").startswith(_NO_CONNECTION)


def _message(kind: type[TaclinkError], details: str, address: str) -> str:
    if kind is Unavailable and details.startswith(_NO_CONNECTION):
        if any(part in details for part in _NOT_TRUSTED):
            return (
                f"the server at {address} does not prove with its certificate that it is that one; check ca_file, and "
                "that the certificate bears this name or address"
            )
        return (
            f"no server answers at {address}; start taclinkd there or choose another address; a server with "
            "TLS needs ca_file, one with client_ca also certificate_file and key_file"
        )
    if kind is Unavailable:
        # The server's own answer (a link that restarts) and a lost connection have the same code.
        return f"the call to the server at {address} failed: {details}; try again, and check that the server runs"
    if kind is Timeout:
        return f"the server at {address} did not answer in time; try again"
    if kind is Unsupported:
        return f"the server at {address} does not offer this ({details})"
    if kind is Unauthenticated:
        return f"{details} (token=... of the client)"
    return details or f"the server at {address} ended the call without a reason"


def from_rpc(error: Any, address: str) -> TaclinkError:
    """Of a grpc.RpcError, blocking or asyncio's."""
    kind = _KINDS.get(error.code(), Internal)
    details = error.details() or ""
    return kind(_message(kind, details, address), details=details, address=address)


def timed_out(address: str) -> Timeout:
    return Timeout(_message(Timeout, "", address), address=address)


def lost(details: str, address: str) -> Unavailable:
    return Unavailable(_message(Unavailable, details, address), details=details, address=address)


def ended_by_server(reason: str, address: str) -> Unavailable:
    return Unavailable(f"the server at {address} ended the stream: {reason}", details=reason, address=address)


def forked(what: str) -> WrongProcess:
    return WrongProcess(
        f"{what}; start processes with multiprocessing.set_start_method('spawn') (PyTorch: "
        "DataLoader(multiprocessing_context='spawn')), or fork before the first client is used, and make a client in "
        "each process"
    )


def closed() -> Cancelled:
    return Cancelled("this client was closed; make another one")
