"""Client side of a MAVLink wire: the simulator as a client of a running autopilot."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from sitl.wire.wire import Outlet, Peer, Wire, WireError, is_port, open_wire

RETRY_S = 0.5
CONNECT_S = 0.3


class TcpClientWire(Wire):
    """TCP client that reconnects after a disconnection.

    Parameters
    ----------
    host, port
        Address at which the autopilot listens.
    clock
        Seconds, for the pause between attempts.
    """

    def __init__(self, host: str, port: int, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        try:
            self._address = socket.gethostbyname(host), port
        except OSError as error:
            raise WireError(f"tcp:{host}:{port}: {error.strerror or error}") from None
        self.name = f"tcp:{host}:{port}"
        self._clock = clock
        self._next_s = clock()
        self._socket: socket.socket | None = None

    def poll(self) -> list[tuple[Peer, bytes]]:
        if self._socket is None:
            self._connect()
        if self._socket is None:
            return []
        try:
            data = self._socket.recv(1 << 18)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if data:
            return [(self.peers[0], data)]
        self.close()
        return []

    def _connect(self) -> None:
        if self._clock() < self._next_s:
            return
        self._next_s = self._clock() + RETRY_S
        try:
            self._socket = socket.create_connection(self._address, CONNECT_S)
        except OSError:
            return  # no server there yet
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.peers.append(Peer(Outlet(self._socket.send)))

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        for peer in self.peers:
            peer.open = False
        self.peers.clear()


def open_client(url: str) -> Wire:
    """Open a wire to an autopilot: tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT or a device path.

    Raises
    ------
    WireError
        The URL is malformed, its host unknown or its port in use.
    """
    kind, _, address = url.partition(":")
    host, _, port = address.rpartition(":")
    if kind == "tcp" and host and is_port(port):
        return TcpClientWire(host, int(port))
    if not url.startswith(("/", "udpin:", "udpout:")):
        raise WireError(
            f"{url!r} is no autopilot's address: write tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT "
            "or a device"
        )
    return open_wire(url)
