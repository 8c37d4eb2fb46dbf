"""Generates taclink/v1 from the protocol and records the version; all else is in pyproject.toml.

`setup.py build_py --build-lib FOLDER` makes the whole package in FOLDER, for use without installing it.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent


def version() -> str:
    """The whole project's; an sdist, which lies alone, has it in PKG-INFO."""
    for file, pattern in (
        (HERE / "PKG-INFO", r"^Version: (\S+)"),
        (PROJECT / "CMakeLists.txt", r"^project\(taclink VERSION (\S+)"),
    ):
        found = re.search(pattern, file.read_text(encoding="utf-8"), re.MULTILINE) if file.is_file() else None
        if found:
            return found.group(1)
    raise SystemExit("no version: neither PKG-INFO here nor the project's CMakeLists.txt two folders up")


def beside(name: str) -> Path:
    """Lies here in an sdist, else in the project."""
    return HERE / name if (HERE / name).exists() else PROJECT / name


def program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        raise SystemExit(f"{name} is missing: apt-get install protobuf-compiler protobuf-compiler-grpc")
    return found


def generate(folder: Path) -> None:
    """Writes what is not in the sources into the package in `folder`."""
    protos = sorted((beside("proto") / "taclink" / "v1").glob("*.proto"))
    if not protos:
        raise SystemExit(f"no protocol in {beside('proto')}")
    subprocess.run(
        [
            program("protoc"),
            f"-I{beside('proto')}",
            f"--plugin=protoc-gen-grpc_python={program('grpc_python_plugin')}",
            *(f"--{kind}_out={folder}" for kind in ("python", "pyi", "grpc_python")),
            *map(str, protos),
        ],
        check=True,
    )
    (folder / "taclink" / "_version.py").write_text(f'__version__ = "{version()}"\n', encoding="utf-8")
    shutil.copy(beside("LICENSE"), folder / "taclink" / "LICENSE")


class Build(build_py):
    def run(self) -> None:
        super().run()
        generate(HERE if getattr(self, "editable_mode", False) else Path(self.build_lib))


class SourceDistribution(sdist):
    def make_release_tree(self, base_dir: str, files: Any) -> None:
        super().make_release_tree(base_dir, files)
        shutil.copytree(beside("proto") / "taclink", Path(base_dir) / "proto" / "taclink")
        shutil.copy(beside("LICENSE"), base_dir)


setup(
    version=version(),
    packages=["taclink", "taclink.aio", "taclink.messages", "taclink.v1"],
    package_data={"taclink": ["py.typed"]},
    include_package_data=False,
    cmdclass={"build_py": Build, "sdist": SourceDistribution},
)
