"""A log's bytes on their way into a file."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType

from taclink._channel import FilePath
from taclink.errors import DataLoss, OutOfRange, TaclinkError, Unavailable
from taclink.v1 import recording_pb2


class Download:
    """Collects in FILE.download, which bears the file's own name once it is whole; what is there already stays."""

    def __init__(self, log: str, path: FilePath) -> None:
        self._log = log
        given = Path(path)
        self.path = given / Path(log).name if given.is_dir() else given
        self._collecting = self.path.with_name(self.path.name + ".download")
        self._file = open(self._collecting, "ab")
        self.taken = self._file.seek(0, os.SEEK_END)
        self.size = 0  # of the whole log, as the server last told it

    def request(self) -> recording_pb2.DownloadLogRequest:
        return recording_pb2.DownloadLogRequest(log=self._log, offset=self.taken)

    def take(self, piece: recording_pb2.DownloadLogResponse) -> None:
        if piece.offset != self.taken:
            raise DataLoss(f"the server sent byte {piece.offset} of {self._log} in place of {self.taken}")
        self._file.write(piece.data)
        self.taken += len(piece.data)
        self.size = piece.size

    def finish(self) -> Path:
        self._file.close()
        if self.taken != self.size:
            raise Unavailable(f"{self.taken} of {self.size} bytes came of {self._log}; the same call goes on")
        return self._collecting.replace(self.path)

    def explained(self, error: TaclinkError) -> TaclinkError:
        if isinstance(error, OutOfRange):
            return OutOfRange(
                f"{error}: {self._collecting} is of another log; delete it", details=error.details
            )
        if isinstance(error, Unavailable):
            return Unavailable(f"{error}; the same call goes on where it broke off", details=error.details)
        return error

    def __enter__(self) -> Download:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
        if self.taken == 0 and self._collecting.exists():
            self._collecting.unlink()
