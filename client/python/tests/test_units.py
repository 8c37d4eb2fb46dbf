"""What needs no server."""

from __future__ import annotations

import inspect
import itertools
import math
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import pytest
from google.protobuf import descriptor_pool

import taclink
import taclink.aio
from taclink import _channel, _reconnect, _requests, errors, names
from taclink._streams import FrameState
from taclink.messages import arrays, contacts, frame
from taclink.v1 import contacts_pb2, frame_pb2, geometry_pb2, tactile_pb2

# Members that say what the first number means.
FIRST = {"NONE", "OFF", "CONFIGURED", "UNSPECIFIED", "UNKNOWN"}


def protocol_enums() -> dict[str, list[str]]:
    pool = descriptor_pool.Default()
    found = {}
    for name in "arm contacts events frame joints log operations pressure recording tactile tare".split():
        for kind in pool.FindFileByName(f"taclink/v1/{name}.proto").enum_types_by_name.values():
            found[kind.name] = [value.name for value in sorted(kind.values, key=lambda value: int(value.number))]
    return found


def test_every_enumeration_of_the_protocol_has_its_names() -> None:
    for name, values in protocol_enums().items():
        kind = getattr(names, name)
        prefix = values[0].removesuffix("UNSPECIFIED")
        members = [member.name for member in kind]
        assert members[0] in FIRST
        assert members[1:] == [value.removeprefix(prefix) for value in values[1:]], name
        if issubclass(kind, names.Name):
            assert [member.value for member in kind] == [member.lower() for member in members]


def test_names_are_texts() -> None:
    status = names.name_of(names.LinkStatus, 3)
    assert status == "ok" and f"{status:<4}|{status}" == "ok  |ok" and hash(status) == hash("ok")
    assert names.name_of(names.LinkStatus, 3) is names.LinkStatus.OK
    assert names.name_of(names.LinkStatus, 99) is names.LinkStatus.UNKNOWN
    assert names.number_of(names.ForceModel, "nonlinear", "model") == 4
    with pytest.raises(taclink.InvalidArgument, match="linear, literal, pressurised, nonlinear, auto, not 'best'"):
        names.number_of(names.ForceModel, "best", "model")


def test_covariances_are_symmetric_matrices() -> None:
    matrix = np.array([[1.0, 2, 3], [2, 4, 5], [3, 5, 6]])
    found = arrays.covariances([1, 2, 3, 4, 5, 6] * 2)
    assert found.shape == (2, 3, 3) and (found == matrix).all()
    assert arrays.covariances([]).shape == (0, 3, 3)
    assert arrays.covariance([]) is None
    assert (arrays.covariance([1, 2, 3, 4, 5, 6]) == matrix).all()


def test_frames_are_frozen_and_keep_shapes_without_content() -> None:
    empty = frame.frame_from(frame_pb2.LinkFrame())
    assert empty.positions_m.shape == empty.nodal_forces_n.shape == (0, 3)
    assert empty.displacement_covariances_m2.shape == (0, 3, 3)
    assert empty.pressure is None and empty.pressure_pa is None and empty.latency_s is None
    with pytest.raises(FrozenInstanceError):
        empty.link = "other"  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        empty.total_force_n[0] = 1


def test_what_is_not_known_is_no_zero() -> None:
    assert np.isnan(frame.frame_from(frame_pb2.LinkFrame()).total_force_n).all()
    arm = contacts.arm_contacts_from(contacts_pb2.StreamContactsResponse(joint_names=["elbow"]))
    assert np.isnan(arm.total_force_n).all() and np.isnan(arm.total_moment_nm).all() and arm.joints == ()
    numbers = ("detection_limit_n", "detection_limit_around_n", "force_residual", "camera_shift_m")
    for place, name in enumerate(numbers, 1):
        assert getattr(frame.frame_from(frame_pb2.LinkFrame()), name) is None
        message = frame_pb2.LinkFrame()
        setattr(message, name, place)
        assert getattr(frame.frame_from(message), name) == place


def test_latency_is_known_only_of_live_pictures() -> None:
    message = frame_pb2.LinkFrame(times=frame_pb2.FrameTimes(exposure_utc_ns=10**9))
    assert frame.frame_from(message, 2 * 10**9).latency_s == 1
    assert frame.frame_from(message).latency_s is None
    message.replayed = True
    assert frame.frame_from(message, 2 * 10**9).latency_s is None


def test_gaps_count_what_lies_between() -> None:
    state = FrameState()
    state._begin()

    def gap(link: str, sequence: int) -> int | None:
        message = tactile_pb2.StreamFramesResponse(frame=frame_pb2.LinkFrame(link=link, sequence=sequence))
        taken = state._take(message)
        assert taken is not None
        return taken.gap

    pairs = [("a", 5), ("b", 7), ("a", 6), ("a", 6), ("a", 10), ("b", 8), ("a", 2), ("a", 3)]
    assert [gap(*pair) for pair in pairs] == [None, None, 0, 0, 3, 0, None, 0]


@pytest.mark.parametrize("stream", [taclink.streams.FrameStream, taclink.aio.streams.FrameStream])
def test_old_frames_are_left_out_and_counted(stream: type[FrameState], monkeypatch: pytest.MonkeyPatch) -> None:
    now_ns = 1_700_000_000 * 10**9
    monkeypatch.setattr("time.time_ns", lambda: now_ns)
    state = stream.__new__(stream)
    state._begin()

    def sequence(link: str, sequence: int, age_s: float, replayed: bool = False) -> tuple[int, int | None] | None:
        message = frame_pb2.LinkFrame(link=link, sequence=sequence, replayed=replayed)
        message.times.exposure_utc_ns = now_ns - round(age_s * 1e9)
        taken = state._take(tactile_pb2.StreamFramesResponse(frame=message))
        return None if taken is None else (taken.sequence, taken.gap)

    assert sequence("a", 1, 3600) == (1, None) and state.too_old == {}  # any age
    state._max_age_s = 0.2
    assert sequence("a", 2, 0.125) == (2, 0)
    assert [sequence("a", 3, 0.25), sequence("a", 4, 17), sequence("b", 4, 22)] == [None] * 3
    assert state.too_old == {"a": 2, "b": 1}
    assert sequence("a", 5, 0) == (5, 2)
    assert sequence("a", 6, -5) == (6, 0)  # this machine's clock is behind
    assert sequence("a", 7, 1e6, replayed=True) == (7, 0)
    without_times = tactile_pb2.StreamFramesResponse(frame=frame_pb2.LinkFrame(link="a", sequence=8))
    assert state._take(without_times) is not None
    assert state.too_old == {"a": 2, "b": 1}


@pytest.mark.parametrize("max_age_s", [0, -1, math.nan, math.inf])
def test_an_age_limit_that_is_none_is_refused(max_age_s: float) -> None:
    with pytest.raises(taclink.InvalidArgument, match="max_age_s must be a positive number"):
        _requests.max_age(max_age_s)
    assert _requests.max_age(None) is None and _requests.max_age(0.1) == 0.1


def test_pauses_double_and_differ() -> None:
    delays = list(itertools.islice(_reconnect.delays_s(), 10))
    longest = [min(0.25 * 2**i, 2.0) for i in range(10)]
    assert all(0.5 * most <= delay <= most for delay, most in zip(delays, longest))
    told: list[tuple[Any, ...]] = []
    attempts = _reconnect.Attempts(lambda *each: told.append(each))
    error = taclink.Unavailable("gone")
    first = [attempts.next_delay_s(error) for _ in range(3)]
    assert told == [(error, i + 1, delay) for i, delay in enumerate(first)]
    attempts.reset()
    assert attempts.next_delay_s(error) <= 0.25 and told[-1][1] == 1


@pytest.mark.parametrize(
    "address, here",
    [
        ("unix:/run/taclink", True),
        ("localhost:1", True),
        ("127.0.0.1:1", True),
        ("127.8.8.8:1", True),
        ("[::1]:1", True),
        ("robot:1", False),
        ("192.0.2.1:1", False),
        ("[2001:db8::1]:1", False),
        ("::1:50051", False),  # another address than [::1]
        ("127.0.0.1.example.org:1", False),  # a name of whoever owns example.org
        ("localhost.example.org:1", False),
        ("dns:///localhost:1", False),
    ],
)
def test_a_token_stays_here_without_tls(address: str, here: bool) -> None:
    assert _channel.stays_here(address) == here
    for kind in (taclink.Client, taclink.aio.Client):
        if here:
            assert "secret" not in repr(kind(address, token="secret").__dict__)
        else:
            with pytest.raises(taclink.InvalidArgument, match="in the clear; use TLS"):
                kind(address, token="secret")


def test_credentials_that_make_no_sense_are_refused(tmp_path: Path) -> None:
    with pytest.raises(taclink.InvalidArgument, match="need each other"):
        taclink.Client(certificate_file=tmp_path / "a")
    with pytest.raises(taclink.InvalidArgument, match="ca_file"):
        taclink.Client(certificate_file=tmp_path / "a", key_file=tmp_path / "b")
    with pytest.raises(taclink.NotFound, match="missing.pem cannot be read"):
        taclink.Client(ca_file=tmp_path / "missing.pem")
    with pytest.raises(taclink.InvalidArgument, match="host:port"):
        taclink.Client("")


class FakeRpcError(grpc.RpcError):  # type: ignore[misc]
    def __init__(self, code: grpc.StatusCode, details: str) -> None:
        self.code = lambda: code
        self.details = lambda: details


def test_every_status_of_grpc_has_an_error() -> None:
    kinds = {}
    for code in grpc.StatusCode:
        if code is grpc.StatusCode.OK:
            continue
        error = errors.from_rpc(FakeRpcError(code, "what happened"), "robot:1")
        kinds[code] = type(error)
        assert isinstance(error, taclink.TaclinkError) and type(error).__name__ in taclink.__all__
        assert error.details == "what happened" and error.address == "robot:1"
        assert "what happened" in str(error) or isinstance(error, taclink.Timeout)
    assert kinds[grpc.StatusCode.FAILED_PRECONDITION] is taclink.Refused
    assert kinds[grpc.StatusCode.UNIMPLEMENTED] is taclink.Unsupported
    assert kinds[grpc.StatusCode.UNKNOWN] is taclink.Internal
    assert "robot:1 ended the call" in str(errors.from_rpc(FakeRpcError(grpc.StatusCode.UNKNOWN, ""), "robot:1"))


def public(kind: type) -> dict[str, Any]:
    return {name: member for name, member in inspect.getmembers(kind) if not name.startswith("_")}


@pytest.mark.parametrize("name", taclink.aio.__all__)
def test_both_clients_have_the_same_methods(name: str) -> None:
    blocking, awaited = public(getattr(taclink, name)), public(getattr(taclink.aio, name))
    assert set(blocking) == set(awaited)
    for method in blocking:
        assert inspect.getdoc(awaited[method]), f"{name}.{method} is not described"
        if inspect.isfunction(blocking[method]):
            here, there = inspect.signature(blocking[method]), inspect.signature(awaited[method])
            assert here.parameters == there.parameters, f"{name}.{method}"
            assert here.return_annotation == there.return_annotation


def test_all_that_is_public_exists_and_is_sorted() -> None:
    assert sorted(taclink.__all__) == taclink.__all__
    assert all(hasattr(taclink, name) for name in taclink.__all__)


def test_forces_from_opposite_sides_do_not_cancel_in_the_magnitude() -> None:
    message = frame_pb2.LinkFrame(total_force_n=geometry_pb2.Vector3())
    for side in (0.7, -0.7):
        message.contacts.add(force_n=geometry_pb2.Vector3(x=side), normal_force_n=0.75)
    message.contacts.add(force_n=geometry_pb2.Vector3(y=0.5), normal_force_n=0.1)  # drags
    pressed = frame.frame_from(message)
    assert [contact.magnitude_n for contact in pressed.contacts] == pytest.approx([0.75, 0.75, 0.5])
    assert pressed.total_magnitude_n == pytest.approx(2.0)
    assert math.isnan(frame.frame_from(frame_pb2.LinkFrame()).total_magnitude_n)
