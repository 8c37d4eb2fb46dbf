"""Faults of what lies on disks: recordings, and pictures that links take from a folder."""

from __future__ import annotations

import errno
import os
import random
import shutil
import subprocess
import time
from pathlib import Path

from faults import Fault, Momentary
from lives import until
from world import TOLD_WITHIN_S, World, pick

from taclink.v1 import frame_pb2

NO_DISK = "it may not mount a disk of its own"


def open_log(world: World) -> Path:
    """The file that is being written; not by the recorder's status, which may be of before it was split."""

    def newest() -> list[tuple[float, Path]]:
        try:
            return sorted((file.stat().st_mtime, file) for file in world.logs.glob("*.part"))
        except FileNotFoundError:  # got its final name just now
            return []

    return Path(until(newest)[-1][1])


class RecorderFault(Fault):
    """Told by the recorder."""

    words = ""  # of what it says

    def begin(self, world: World) -> None:
        self._begun = time.monotonic()
        for _ in range(2):  # what is closed while others are read, too: the fault must not harm it
            world.auditor.take_closed(world.server.life)
        self.harm(world)

    def harm(self, world: World) -> None:
        raise NotImplementedError

    def check(self, world: World) -> None:
        world.told(
            self.name,
            lambda: world.recorder.told_since(self._begun, self.words),
            f"'{self.words}' by the recorder, which says {world.recorder.troubles[-3:]}",
        )


class LogDeleted(RecorderFault):
    name = "log deleted"
    words = "was deleted while it was written"

    def harm(self, world: World) -> None:
        open_log(world).unlink()


class LogCut(RecorderFault):
    name = "log cut"
    words = "was cut by another program"

    def harm(self, world: World) -> None:
        self._log = open_log(world)
        os.truncate(self._log, 100)

    def end(self, world: World) -> None:
        """Nothing in it can be made whole, and nobody but a person may delete it."""
        self._log.unlink()


class FolderDeleted(RecorderFault):
    name = "folder of logs deleted"
    words = "was deleted while it was written"

    def harm(self, world: World) -> None:
        shutil.rmtree(world.logs, ignore_errors=True)  # the next log may begin in it meanwhile

    def end(self, world: World) -> None:
        until(world.logs.is_dir, TOLD_WITHIN_S)


class FolderMoved(RecorderFault):
    name = "folder of logs moved"
    words = "was moved"

    def harm(self, world: World) -> None:
        self._away = world.disk / "away"
        world.logs.rename(self._away)

    def end(self, world: World) -> None:
        """What was recorded is where it is now, closed."""
        moved = {file.name.removesuffix(".part") for file in self._away.iterdir()}
        until(lambda: world.recorder.status is not None and world.recorder.status.log not in moved, TOLD_WITHIN_S)
        for file in [*self._away.glob("faults-*.mcap"), *self._away.glob("faults-*.part")]:
            world.auditor.take_log(file, world.server.life)
        shutil.rmtree(self._away)


class OwnDiskFault(RecorderFault):
    """Of a disk that the run has mounted for itself."""

    @staticmethod
    def why_not(world: World) -> str:
        return "" if world.own_disk else NO_DISK


class FolderReadOnly(OwnDiskFault):
    name = "folder of logs read-only"
    words = "Read-only file system"

    def harm(self, world: World) -> None:
        subprocess.run(["mount", "--bind", world.logs, world.logs], check=True)
        subprocess.run(["mount", "-o", "remount,bind,ro", world.logs], check=True)

    def end(self, world: World) -> None:
        subprocess.run(["umount", "--lazy", world.logs], check=True)


class DiskFull(OwnDiskFault):
    name = "disk full"
    words = "No space left"

    def harm(self, world: World) -> None:
        self._filler = world.disk / "filler"
        with open(self._filler, "wb", buffering=0) as out:
            for size in (1 << 20, 1 << 12):
                try:
                    while out.write(bytes(size)) == size:
                        pass
                except OSError as error:
                    if error.errno != errno.ENOSPC:
                        raise

    def end(self, world: World) -> None:
        self._filler.unlink()


class PictureFault(Fault):
    """Of a link that takes its pictures from a folder; told in its frames."""

    link = "film"

    def begin(self, world: World) -> None:
        self._told = False
        world.ledger.watch = self._look
        self._folder = world.folder / self.link
        self.harm(world)

    def harm(self, world: World) -> None:
        raise NotImplementedError

    def mend(self, world: World) -> None:
        raise NotImplementedError

    def is_it(self, frame: frame_pb2.LinkFrame) -> bool:
        raise NotImplementedError

    def check(self, world: World) -> None:
        world.told(self.name, lambda: self._told, f"in the frames of {self.link}")

    def end(self, world: World) -> None:
        self.mend(world)
        world.ledger.watch = None

    def _look(self, frame: frame_pb2.LinkFrame) -> None:
        if frame.link == self.link and self.is_it(frame):
            self._told = True


class FolderUnplugged(PictureFault):
    name = "folder of pictures gone"

    def harm(self, world: World) -> None:
        self._folder.rename(world.folder / "unplugged")

    def mend(self, world: World) -> None:
        (world.folder / "unplugged").rename(self._folder)

    def is_it(self, frame: frame_pb2.LinkFrame) -> bool:
        return frame.status == frame_pb2.LINK_STATUS_LOST and bool(frame.status_reason)


class PictureDamaged(PictureFault):
    name = "pictures damaged"
    link = "tape"

    def __init__(self, rng: random.Random) -> None:
        super().__init__(rng)
        self._number = rng.randrange(5, 15)
        self._camera = rng.choice(("top", "bottom"))
        self._share = pick(rng, 0, 0.9)

    def harm(self, world: World) -> None:
        self._file = self._folder / f"{self._camera}_{self._number:06}.png"
        self._bytes = self._file.read_bytes()
        self._file.write_bytes(self._bytes[: int(len(self._bytes) * self._share)] + b"not a picture any more")

    def mend(self, world: World) -> None:
        self._file.write_bytes(self._bytes)

    def is_it(self, frame: frame_pb2.LinkFrame) -> bool:
        return any(reason.reason == frame_pb2.REASON_CAMERA for reason in frame.status_reasons)

    def note(self) -> str:
        return f"{self._file.name if hasattr(self, '_file') else self._camera} to {self._share:.0%}"


class Replugged(Momentary):
    """So short that it may pass unnoticed."""

    name = "folder of pictures back soon"
    comes_into_others = True

    def begin(self, world: World) -> None:
        folder, away = world.folder / "film", world.folder / "replugged"
        folder.rename(away)
        time.sleep(0.3)
        away.rename(folder)


ALL = (
    LogDeleted,
    LogCut,
    FolderDeleted,
    FolderMoved,
    FolderReadOnly,
    DiskFull,
    FolderUnplugged,
    PictureDamaged,
    Replugged,
)
