"""gRPC and fork().

gRPC's threads, locks and epoll sets do not survive a fork: a child that uses what it inherited hangs, and takes its
parent along, whose epoll sets it changes. So nothing that was made of gRPC is touched in another process than its
own, and a process whose parent used gRPC may not use it, with one exception (check()).
"""

from __future__ import annotations

import os
import weakref
from typing import Any

from taclink import errors

_user: int | None = None  # the process that uses gRPC: this one, or one that it was forked from
_channels: weakref.WeakSet[Any] = weakref.WeakSet()  # of this process, and open
_had_channels = False  # the parent, at the fork


def _in_child() -> None:
    global _channels, _had_channels
    _had_channels = _had_channels or len(_channels) > 0
    _channels = weakref.WeakSet()


os.register_at_fork(after_in_child=_in_child)


def _is_supported() -> bool:
    """gRPC was asked to make forks possible, and can: it cannot while it is used in other threads."""
    asked = os.environ.get("GRPC_ENABLE_FORK_SUPPORT", "").lower() in ("1", "true", "yes", "y")
    return asked and not _had_channels


def check() -> None:
    """Before anything is made of gRPC. Errors: WrongProcess."""
    global _user
    if _user not in (None, os.getpid()) and not _is_supported():
        raise errors.forked(
            f"process {os.getpid()} was forked from process {_user}, which had used a client, and gRPC does not work "
            "in such a child"
        )
    _user = os.getpid()


class Owned:
    """What belongs to the process that first uses it."""

    _process: int | None = None

    def own(self) -> None:
        """Before each use. Errors: WrongProcess."""
        if self.is_inherited():
            raise errors.forked(
                f"this client was made in process {self._process} and cannot be used in process {os.getpid()}, which "
                "was forked from it"
            )
        check()
        self._process = os.getpid()

    def is_inherited(self) -> bool:
        return self._process not in (None, os.getpid())


def opened(channel: Any) -> None:
    _channels.add(channel)


def closed(channel: Any) -> None:
    _channels.discard(channel)
