"""A server under random faults, with clients that hold it to what it promises.

    run.py --programs FOLDER [--seconds 60] [--seed N] [--only NAME] [--keep FOLDER]

Four links, a recorder, a replay and clients of all kinds; faults come one after the other, and some into others, in an
order that follows from the seed. Whatever happens: what was synced is in the logs, a client has each frame or is told
how many it missed, faults are told, the server does not end by itself, and holds afterwards what it held before.
Exit status 1: something of this is not so.
"""

from __future__ import annotations

import argparse
import atexit
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
DISK_MB = 160
IN_NAMESPACE = "TACLINK_FAULTS_NAMESPACE"


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=Path, required=True, help="folder of taclinkd and taclink")
    parser.add_argument("--step-clock", type=Path, required=True, help="the library step_clock")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=None, help="default: any")
    parser.add_argument("--only", action="append", default=[], help="faults with this in their name")
    parser.add_argument("--keep", type=Path, help="works in this folder, and leaves it")
    return parser.parse_args()


def enter_namespace() -> None:
    """Goes on in mounts of its own, which go with the process; where that is not allowed, without."""
    if IN_NAMESPACE in os.environ:
        return
    for options in (["--mount"], ["--user", "--map-root-user", "--mount"]):
        command = ["unshare", *options, "--propagation", "private"]
        if subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0:
            os.environ[IN_NAMESPACE] = "yes"
            os.execvp(command[0], [*command, sys.executable, "-B", *sys.argv])
    os.environ[IN_NAMESPACE] = "no"


def mount_disk(folder: Path) -> bool:
    """A small one; False: it may not."""
    folder.mkdir(parents=True)
    if os.environ[IN_NAMESPACE] != "yes":
        return False
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "none", str(folder)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def build_client(folder: Path) -> None:
    built = subprocess.run(
        [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(folder)],
        cwd=PROJECT / "client" / "python",
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if built.returncode != 0:
        sys.exit(f"the Python client can't be built: {built.stderr}")
    sys.path.insert(0, str(folder))


def main() -> int:
    arguments = parse_arguments()
    enter_namespace()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    seed = random.SystemRandom().randrange(1 << 31) if arguments.seed is None else arguments.seed
    print(f"seed {seed}, {arguments.seconds:g} s of faults", flush=True)
    folder = arguments.keep or Path(tempfile.mkdtemp(prefix="taclink-faults-"))
    own_disk = mount_disk(folder / "disk")

    def clean_up() -> None:
        if own_disk:
            subprocess.run(["umount", "--lazy", str(folder / "disk")], check=False)
        if not arguments.keep:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(clean_up)
    build_client(folder / "python")
    import campaign  # needs the client

    return campaign.run(arguments, folder, own_disk, seed)


if __name__ == "__main__":
    begun = time.monotonic()
    code = main()
    print(f"{time.monotonic() - begun:.0f} s in all", flush=True)
    sys.stdout.flush()
    sys.exit(code)
