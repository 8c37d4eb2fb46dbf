"""One frame with every field set, and one event of every kind with every kind of detail, go to all clients; what each
prints must hold all of it. A field or kind that a client does not know fails here.

    conformance.py SOURCE FOLDER-OF-PROGRAMS CLIENT     (cpp, command, python, node, ruby or browser)
"""

from __future__ import annotations

import atexit
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import threading
from concurrent import futures
from typing import Any

import grpc

source, programs, client = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]
here = pathlib.Path(__file__).resolve().parent
scratch = pathlib.Path(tempfile.mkdtemp(prefix="taclink-conformance-"))
atexit.register(shutil.rmtree, scratch, ignore_errors=True)
subprocess.run(
    [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(scratch)],
    cwd=source / "client/python",
    check=True,
    stdout=subprocess.DEVNULL,
    env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
)
sys.path[:0] = [str(scratch), str(here)]

from messages import enum_name, fill, leaves  # noqa: E402

from taclink.v1 import events_pb2, frame_pb2, operations_pb2, recording_pb2, tactile_pb2  # noqa: E402

# Names that clients use in place of the protocol's.
RENAMED = {"python": {"force_not_converged": "force_converged"}}
KIND = events_pb2.Event.DESCRIPTOR.fields_by_name["kind"]


def frame() -> Any:
    message = fill(frame_pb2.LinkFrame())
    for reason in message.status_reasons:  # a client may go by either
        reason.id = enum_name(reason.DESCRIPTOR.fields_by_name["reason"], reason.reason)
    message.unchanged = message.replayed = False  # these would change what a client shows
    message.force_not_converged = False
    return message


def events() -> list[Any]:
    details = [field.name for field in events_pb2.Event.DESCRIPTOR.oneofs_by_name["detail"].fields]
    out = []
    for place, kind in enumerate(KIND.enum_type.values[1:]):
        message = fill(events_pb2.Event(), only=details[place % len(details)])
        message.kind = kind.number
        message.sequence = place + 1
        out.append(message)
    return out


class Server(grpc.GenericRpcHandler):
    """Answers every unary call with a filled response, and streams the frame and the events."""

    def __init__(self) -> None:
        self.methods = {}
        for file in (tactile_pb2, recording_pb2, operations_pb2):
            for service in file.DESCRIPTOR.services_by_name.values():
                for method in service.methods:
                    self.methods[f"/{service.full_name}/{method.name}"] = method

    def service(self, call: Any) -> Any:
        from google.protobuf import message_factory

        method = self.methods.get(call.method)
        if method is None or method.client_streaming:
            return None
        of = getattr(message_factory, "GetMessageClass", None) or message_factory.MessageFactory().GetPrototype
        response = of(method.output_type)

        def stream(_request: Any, context: Any) -> Any:
            if method.name == "StreamFrames":
                yield tactile_pb2.StreamFramesResponse(status=tactile_pb2.StreamStatus())
                yield tactile_pb2.StreamFramesResponse(frame=frame())
            elif method.name == "StreamEvents":
                yield events_pb2.StreamEventsResponse(status=events_pb2.EventStreamStatus(run_id="one"))
                for event in events():
                    yield events_pb2.StreamEventsResponse(event=event)
            else:
                context.abort(grpc.StatusCode.UNIMPLEMENTED, "not in this test")
            ended = futures.Future()
            context.add_callback(lambda: ended.set_result(None))
            ended.result(timeout=60)

        to_bytes = lambda message: message.SerializeToString()  # noqa: E731
        if method.server_streaming:
            return grpc.unary_stream_rpc_method_handler(stream, response_serializer=to_bytes)
        return grpc.unary_unary_rpc_method_handler(
            lambda _request, _context: fill(response()), response_serializer=to_bytes
        )


def command(address: str) -> list[str]:
    """Prints one JSON object a line: the frame, then the events."""
    if client == "cpp":
        return [os.environ["PRINT_MESSAGES"], address, str(len(events()))]
    if client == "python":
        return [sys.executable, str(here / "print_messages.py"), address, str(len(events()))]
    if client == "node":
        return ["node", str(source / "client/node/tests/print_messages.mjs"), address, str(len(events()))]
    if client == "ruby":
        return ["/usr/bin/ruby", str(source / "client/ruby/test/print_messages.rb"), address, str(len(events()))]
    (scratch / "frame").write_bytes(frame().SerializeToString())
    for place, event in enumerate(events()):
        (scratch / f"event{place}").write_bytes(event.SerializeToString())
    files = [str(scratch / "frame"), *(str(scratch / f"event{place}") for place in range(len(events())))]
    return ["npx", "--no-install", "vite-node", "browser/print_messages.ts", *files]


def printed_leaves(value: Any, name: str = "") -> list[tuple[str, Any]]:
    if isinstance(value, dict):
        vector = set(value) == {"x", "y", "z"}
        pairs = [printed_leaves(part, name if vector else key) for key, part in value.items()]
        return [leaf for part in pairs for leaf in part]
    if isinstance(value, list):
        return [leaf for part in value for leaf in printed_leaves(part, name)]
    return [(name, value)]


def plain(value: Any) -> Any:
    """Numbers as numbers, also where a client prints 64 bits as text; names of enums without their prefix."""
    if isinstance(value, bool) or value is None:
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        return str(value).lower()


def same(expected: Any, found: Any) -> bool:
    if isinstance(expected, bool):
        return True  # that it is there is all that can be compared
    expected, found = plain(expected), plain(found)
    if isinstance(expected, float) and isinstance(found, float):
        return math.isclose(expected, found, rel_tol=1e-6)
    return expected == found or (isinstance(found, str) and isinstance(expected, str) and found.endswith("_" + expected))


def complaints(message: Any, printed: Any, what: str) -> list[str]:
    found = printed_leaves(printed)
    renamed = RENAMED.get(client, {})
    out = []
    for name, value in leaves(message):
        of_name = [other for key, other in found if key == renamed.get(name, name)]
        number = isinstance(value, str) and any(isinstance(other, int) for other in of_name)  # an enum in an array
        if not of_name or not (number or any(same(value, other) for other in of_name)):
            out.append(f"{client} does not print {what}: {name} = {value} (of that name: {of_name[:3]})")
    return out


def check_command(address: str) -> list[str]:
    """`taclink events` names every kind."""
    run = subprocess.Popen(
        [str(programs / "taclink"), "events", "--json", "--server", address], stdout=subprocess.PIPE, text=True
    )
    patience = threading.Timer(120, run.kill)
    patience.start()
    kinds = []
    try:
        assert run.stdout is not None
        for line in run.stdout:
            kinds.append(json.loads(line).get("kind"))
            if len(kinds) == len(events()):
                break
    finally:
        patience.cancel()
        run.kill()
        run.wait()
    expected = [enum_name(KIND, event.kind) for event in events()]
    return [] if kinds == expected else [f"taclink events prints {kinds}, not {expected}"]


def main() -> int:
    pings = [("grpc.http2.min_ping_interval_without_data_ms", 1000), ("grpc.http2.max_ping_strikes", 0)]
    server = grpc.server(futures.ThreadPoolExecutor(max_workers=8), options=pings)
    server.add_generic_rpc_handlers((Server(),))
    address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    server.start()
    try:
        if client == "command":
            wrong = check_command(address)
        else:
            run = subprocess.run(
                command(address), cwd=source / "web" if client == "browser" else None, capture_output=True, text=True,
                timeout=240, check=False, env=os.environ | {"PYTHONPATH": str(scratch)},
            )
            lines = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
            if run.returncode != 0 or len(lines) != 1 + len(events()):
                print(run.stdout[-3000:], run.stderr[-3000:], f"{client}: {len(lines)} lines", sep="\n")
                return 1
            wrong = complaints(frame(), lines[0], "a frame's")
            for event, line in zip(events(), lines[1:]):
                wrong += complaints(event, line, f"a {enum_name(KIND, event.kind)} event's")
    finally:
        server.stop(None)
    print(*wrong, f"{client}: {'fails' if wrong else 'knows all'}", sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
