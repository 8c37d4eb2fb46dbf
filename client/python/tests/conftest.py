"""Builds the package into a folder of its own, and starts the server that most tests share."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Iterator

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
LIBRARY = Path(tempfile.mkdtemp(prefix="taclink-python-"))
atexit.register(shutil.rmtree, LIBRARY, ignore_errors=True)
subprocess.run(
    [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(LIBRARY)],
    cwd=PACKAGE,
    check=True,
    env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
)
sys.path.insert(0, str(LIBRARY))

import server as servers  # noqa: E402

import taclink  # noqa: E402

PRESSED = (
    ", regions: [{name: near, rings: [4, 6], paths: [5, 9], warning_n: 0.1}]"
    ", pose: {position_mm: [10, 20, 30], rotation_deg: [90, 0, 90]}"
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if not servers.TACLINKD.exists():
        raise pytest.UsageError(f"{servers.TACLINKD} is missing: build it, or name it in TACLINKD")


@pytest.fixture(scope="session")
def library() -> Path:
    """Where the built package lies."""
    return LIBRARY


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[servers.Server]:
    """Of the links `pressed`, by 0.2 N from some seconds after its start on, and `idle`."""
    config = servers.HEAD + servers.links(
        servers.link("pressed", "press", PRESSED),
        servers.link("idle", "rest", ", pose: {position_mm: [0, 0, 240]}"),
    )
    running = servers.measuring(tmp_path_factory.mktemp("server"), config, "pressed")
    yield running
    running.stop()


@pytest.fixture
def client(server: servers.Server) -> Iterator[taclink.Client]:
    with taclink.Client(server.address, timeout=servers.PATIENCE_S) as connected:
        yield connected


@pytest.fixture
def touched(client: taclink.Client) -> None:
    """`pressed` is, by the whole force."""
    for frame in client.frames("pressed"):
        assert frame.sequence < servers.RATE_HZ * 7000, f"{frame.status}: {frame.status_reason}"
        if frame.status == "ok" and abs(frame.total_force_n).max() > 0.19:
            return


@pytest.fixture
def measuring(client: taclink.Client) -> None:
    """Both links do."""
    servers.until(lambda: all(link.status == "ok" for link in client.arm().links), "both links measure")
