"""The simulator's clock as a service: a client that is idle lets time pass.

One byte 0x01 asks for one step; eight bytes answer, the simulated time in nanoseconds, little endian. What
was sent during the step lies in the sockets before the answer does.
"""

from __future__ import annotations

import select
import socket
import struct
from collections.abc import Callable

from sitl.wire.wire import WireError


class LockstepServer:
    """Serves one client on the loopback."""

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
        """Step on request until the client hangs up or `ended`."""
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
