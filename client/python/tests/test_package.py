"""The package as it is given away."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
PROJECT = PACKAGE.parents[1]
ENVIRONMENT = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


def run(folder: Path, *command: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env=ENVIRONMENT | environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources, so that nothing is built among them."""
    top = tmp_path_factory.mktemp("project")
    shutil.copy(PROJECT / "CMakeLists.txt", top)
    shutil.copy(PROJECT / "LICENSE", top)
    shutil.copytree(PROJECT / "proto", top / "proto")
    ignored = shutil.ignore_patterns("build", "dist", "*.egg-info", "__pycache__", "*_pb2*", "_version.py", "names.py")
    shutil.copytree(PACKAGE, top / "client" / "python", ignore=ignored)
    return top / "client" / "python"


def expected_version() -> str:
    found = re.search(r"^project\(taclink VERSION (\S+)", (PROJECT / "CMakeLists.txt").read_text(), re.MULTILINE)
    assert found is not None
    return found[1]


def check_installed(folder: Path, elsewhere: Path) -> None:
    code = (
        "import importlib.metadata as m, taclink, taclink.aio; from taclink.v1 import tactile_pb2_grpc;"
        "print(taclink.__version__, m.version('taclink'), taclink.__file__, m.requires('taclink'))"
    )
    version, distribution, place, requirements = run(elsewhere, "-c", code, PYTHONPATH=str(folder)).split(" ", 3)
    assert version == distribution == expected_version()
    assert Path(place) == folder / "taclink" / "__init__.py"
    for requirement in ("grpcio", "protobuf", "numpy", "matplotlib"):
        assert requirement in requirements
    assert (folder / "taclink" / "py.typed").exists() and (folder / "taclink" / "LICENSE").exists()
    generated = {path.name for path in (folder / "taclink" / "v1").iterdir()}
    for proto in (PROJECT / "proto" / "taclink" / "v1").glob("*.proto"):
        assert {f"{proto.stem}_pb2.py", f"{proto.stem}_pb2.pyi", f"{proto.stem}_pb2_grpc.py"} <= generated


def test_a_wheel_comes_of_the_sdist_alone(copy: Path, tmp_path: Path) -> None:
    run(copy, "-m", "build", "--no-isolation", "--sdist", "--outdir", str(tmp_path))
    (sdist,) = tmp_path.glob("taclink-*.tar.gz")
    shutil.unpack_archive(sdist, tmp_path / "alone")
    (alone,) = (tmp_path / "alone").iterdir()
    run(alone, "-m", "build", "--no-isolation", "--wheel", "--outdir", str(tmp_path))
    (wheel,) = tmp_path.glob("taclink-*-py3-none-any.whl")
    assert wheel.name.split("-")[1] == expected_version()
    target = tmp_path / "target"
    run(tmp_path, "-m", "pip", "install", "--no-deps", "--no-index", "--target", str(target), str(wheel))
    check_installed(target, tmp_path)


def test_pip_installs_the_checkout(copy: Path, tmp_path: Path) -> None:
    target = tmp_path / "target"
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--target", str(target))
    run(copy.parents[1], "-m", "pip", "install", *options, "./client/python")
    check_installed(target, tmp_path)


def test_the_sources_stay_clean(library: Path) -> None:
    assert list(library.rglob("*_pb2*"))
    assert not [path for path in (PACKAGE / "taclink").rglob("*") if "_pb2" in path.name or path.name in ("_version.py", "names.py")]


def test_types_are_complete(library: Path, tmp_path: Path) -> None:
    if os.environ.get("CI") != "true":  # there every test must run, and the command below says what is missing
        pytest.importorskip("mypy", reason="mypy is not installed: apt-get install mypy")
    sources = [str(path) for path in library.rglob("*.py") if "_pb2" not in path.name]
    users = [str(path) for folder in ("examples", "tests") for path in (PACKAGE / folder).glob("*.py")]
    options = ("--config-file", str(PACKAGE / "pyproject.toml"), "--cache-dir", str(tmp_path))
    path = os.pathsep.join([str(library), str(PACKAGE / "examples"), str(PACKAGE / "tests")])
    run(tmp_path, "-m", "mypy", "--strict", *options, *sources, *users, MYPYPATH=path)
