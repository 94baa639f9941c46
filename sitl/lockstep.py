"""Lock-step server: a client that is idle advances the simulator's clock.

A byte 0x01 requests one step; the answer is eight bytes, the simulated time in nanoseconds, little endian.
Data sent during the step is in the sockets before the answer.
"""

from __future__ import annotations

import select
import socket
import struct
from collections.abc import Callable

from sitl.wire.wire import WireError


class LockstepServer:
    """Server for one client on the loopback interface."""

    def __init__(self, port: int = 0) -> None:
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind(("127.0.0.1", port))
        except OSError as error:
            self._server.close()
            raise WireError(f"lockstep port {port}: {error.strerror}") from None
        self._server.listen(1)
        self.port = int(self._server.getsockname()[1])

    def serve(self, step: Callable[[], int], ended: Callable[[], bool]) -> None:
        """Step on request until the client disconnects or `ended` is true."""
        client = self._wait(ended)
        if client is None:
            return
        with client:
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while not ended():
                if not select.select([client], [], [], 0.2)[0]:
                    continue
                try:
                    asked = client.recv(1)
                    if not asked:
                        return
                    client.sendall(struct.pack("<q", step()))
                except OSError:
                    return

    def _wait(self, ended: Callable[[], bool]) -> socket.socket | None:
        while not ended():
            if select.select([self._server], [], [], 0.2)[0]:
                return self._server.accept()[0]
        return None

    def close(self) -> None:
        self._server.close()
