"""How a client reaches its server and shows who it is."""

from __future__ import annotations

import ipaddress
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Union

import grpc

from taclink._patience import patience_s
from taclink._process import check
from taclink.errors import InvalidArgument, NotFound
from taclink.v1 import (
    operations_pb2_grpc,
    pressure_pb2_grpc,
    recording_pb2_grpc,
    simulation_pb2_grpc,
    tactile_pb2_grpc,
)

DEFAULT_ADDRESS = "127.0.0.1:50051"
FilePath = Union[str, "os.PathLike[str]"]

PING_ANSWER_S = 5.0
ATTEMPT_S = 20.0  # gRPC's own


def options() -> tuple[tuple[str, int], ...]:
    """Errors: InvalidArgument (TACLINK_PATIENCE_S)."""
    return (
        ("grpc.enable_http_proxy", 0),  # robots are on the local network
        # A connection of its own: on a shared one, a stream that is not read would hold up the others.
        ("grpc.use_local_subchannel_pool", 1),
        # A server or a network that vanished without a word is noticed within 15 s. Servers allow a ping each 5 s.
        ("grpc.keepalive_time_ms", 10_000),
        ("grpc.keepalive_timeout_ms", round(1e3 * patience_s(PING_ANSWER_S))),
        ("grpc.http2.max_pings_without_data", 0),
        # Despite its name: how long one attempt to connect may take.
        ("grpc.min_reconnect_backoff_ms", round(1e3 * patience_s(ATTEMPT_S))),
    )


@dataclass(frozen=True)
class Settings:
    """What a channel is made of; the token is not shown."""

    address: str
    credentials: Any = field(repr=False)  # None: in the clear
    metadata: tuple[tuple[str, str], ...] = field(repr=False)  # goes with each call
    options: tuple[tuple[str, int], ...] = field(repr=False)  # gRPC's


def stubs(channel: Any) -> dict[str, Any]:
    """By the name that Call.service has."""
    return {
        "tactile": tactile_pb2_grpc.TactileServiceStub(channel),
        "operations": operations_pb2_grpc.OperationsServiceStub(channel),
        "pressure": pressure_pb2_grpc.PressureServiceStub(channel),
        "recording": recording_pb2_grpc.RecordingServiceStub(channel),
        "simulation": simulation_pb2_grpc.SimulationServiceStub(channel),
    }


def stays_here(address: str) -> bool:
    """Nothing that is sent to it leaves this machine."""
    if address.startswith("unix:"):
        return True
    host = address.rpartition(":")[0] or address
    if host in ("localhost", "[::1]"):
        return True
    try:  # not by its beginning: 127.0.0.1.example.org is a name like any other
        return ipaddress.IPv4Address(host).is_loopback
    except ValueError:
        return False


def _read(path: FilePath | None) -> bytes | None:
    if path is None:
        return None
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise NotFound(f"{os.fspath(path)} cannot be read ({error.strerror}); check the path") from error


def settings(
    address: str,
    token: str | None,
    ca_file: FilePath | None,
    certificate_file: FilePath | None,
    key_file: FilePath | None,
) -> Settings:
    """Errors: InvalidArgument (cannot be used so), NotFound (a file)."""
    if not address:
        raise InvalidArgument("the server's address must be host:port")
    if (certificate_file is None) != (key_file is None):
        raise InvalidArgument("a client's certificate and its key need each other")
    if certificate_file is not None and ca_file is None:
        raise InvalidArgument(
            "a client's certificate needs TLS: say with ca_file whom to trust as the server"
        )
    if token and ca_file is None and not stays_here(address):
        raise InvalidArgument(f"the token would go to {address} in the clear; use TLS (ca_file)")
    credentials = None
    if ca_file is not None:
        check()  # gRPC makes something of them
        credentials = grpc.ssl_channel_credentials(_read(ca_file), _read(key_file), _read(certificate_file))
    metadata = (("authorization", f"Bearer {token}"),) if token else ()
    return Settings(address, credentials, metadata, options())
