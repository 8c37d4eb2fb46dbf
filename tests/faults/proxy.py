"""A network between a client and the server that can be made a bad one."""

from __future__ import annotations

import select
import socket
import struct
import threading
from pathlib import Path


class Proxy:
    """Takes TCP connections for a server's Unix socket."""

    def __init__(self, server: Path) -> None:
        self._server = server
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self._listener.getsockname()[1]
        self._flows = threading.Event()
        self._flows.set()
        self._cut_after: int | None = None  # bytes to the clients
        self._pairs: set[tuple[socket.socket, socket.socket]] = set()
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    def stall(self) -> None:
        """Nothing arrives any more, and nobody is told."""
        self._flows.clear()

    def flow(self) -> None:
        self._flows.set()

    def reset(self) -> None:
        """Ends all connections as a router that has lost its tables does."""
        with self._lock:
            for pair in self._pairs:
                self._end(pair)

    def cut_after(self, count: int) -> None:
        """Ends the connections once so many bytes more have gone to the clients, also in the middle of a message."""
        self._cut_after = count

    def _accept(self) -> None:
        while True:
            client, _ = self._listener.accept()
            server = socket.socket(socket.AF_UNIX)
            try:
                server.connect(str(self._server))
            except OSError:
                client.close()
                server.close()
                continue
            with self._lock:
                self._pairs.add((client, server))
            threading.Thread(target=self._carry, args=((client, server),), daemon=True).start()

    def _carry(self, pair: tuple[socket.socket, socket.socket]) -> None:
        client, server = pair
        try:
            while True:
                for source in select.select(pair, (), ())[0]:
                    data = source.recv(65536)
                    self._flows.wait()
                    if not data:
                        return
                    if source is server:
                        data = self._shortened(data)
                        client.sendall(data)
                        if self._cut_after == 0:
                            return
                    else:
                        server.sendall(data)
        except (OSError, ValueError):
            pass
        finally:
            with self._lock:
                self._pairs.discard(pair)
                self._end(pair)
                client.close()
                server.close()

    def _shortened(self, data: bytes) -> bytes:
        if self._cut_after is None:
            return data
        data = data[: self._cut_after]
        self._cut_after -= len(data)
        if self._cut_after == 0:
            threading.Timer(0.2, self._heal).start()
        return data

    def _heal(self) -> None:
        self._cut_after = None

    @staticmethod
    def _end(pair: tuple[socket.socket, socket.socket]) -> None:
        for end in pair:
            try:
                if end.family == socket.AF_INET:
                    end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
