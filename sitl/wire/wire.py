"""MAVLink wires (sockets, serial lines, in-memory pairs) and the router of messages between them.

Nothing blocks: `read` processes only data that has arrived. A link model delays, loses, duplicates or
corrupts frames in simulated time.
"""

from __future__ import annotations

import errno
import heapq
import os
import socket
import struct
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.wire.message_signing import keep_time, sign


class WireError(ValueError):
    """A wire cannot be opened as requested; the message is one line for the user."""


@dataclass(slots=True)
class LinkModel:
    """Effects of a radio or a bad plug on frames; probabilities from 0 to 1."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0
    cut: bool = False


class Peer:
    """Remote end of a wire: its MAVLink codec, and the output for its bytes."""

    def __init__(self, write: Callable[[bytes], None]) -> None:
        self.write = write
        self.codec: Any = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self.codec.robust_parsing = True
        self.open = True
        self.bad = 0

    def parse(self, data: bytes) -> list[Any]:
        """Return the messages that these bytes complete; invalid data is counted."""
        good: list[Any] = []
        rest, left = bytearray(data), -1
        while True:
            try:
                message = self.codec.parse_char(rest)
            except Exception:  # the parser itself fails on some frames; a peer must not stop the simulation
                self.bad += 1
                left, before = self.codec.buf_len(), left
                if left == before:
                    return good  # the parser makes no more progress
            else:
                if message is None:
                    return good
                if message.get_type() == "BAD_DATA":
                    self.bad += 1
                else:
                    good.append(message)
            rest = bytearray()  # the remaining bytes are in the parser's buffer


class Outlet:
    """Writer of frames to a stream that may be full: each frame is sent completely or not at all."""

    def __init__(self, send: Callable[[bytes], int]) -> None:
        self._send = send
        self._rest = b""

    def __call__(self, data: bytes) -> None:
        try:
            if self._rest:
                self._rest = self._rest[self._send(self._rest) :]
            if not self._rest:
                self._rest = data[self._send(data) :]
        except OSError:
            return  # full or gone; `poll` notices the latter


class Wire(ABC):
    """Base class of wires: `poll` returns (peer, bytes) of all arrived data."""

    name = ""

    def __init__(self) -> None:
        self.peers: list[Peer] = []

    @abstractmethod
    def poll(self) -> list[tuple[Peer, bytes]]: ...

    @abstractmethod
    def close(self) -> None: ...


class UdpWire(Wire):
    """UDP wire: `udpout` sends to a fixed address; `udpin` replies to the newest sender."""

    def __init__(self, kind: str, host: str, port: int) -> None:
        super().__init__()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._fixed = kind == "udpout"
        self._to: tuple[str, int] | None = None
        if self._fixed:
            self._to = _resolved(self._socket, host, port, kind), port
        else:
            _bind(self._socket, host, port, kind)
            port = self._socket.getsockname()[1]
        self.name = f"{kind}:{host}:{port}"
        self.peers.append(Peer(self._write))

    def _write(self, data: bytes) -> None:
        if self._to is not None:
            try:
                self._socket.sendto(data, self._to)
            except OSError:
                return  # no receiver, or the buffer is full: UDP loses the frame

    def poll(self) -> list[tuple[Peer, bytes]]:
        got: list[tuple[Peer, bytes]] = []
        while True:
            try:
                data, sender = self._socket.recvfrom(65536)
            except BlockingIOError:
                return got
            except ConnectionError:
                continue  # a refused datagram is reported as an error of the next call
            except OSError:
                return got
            if not self._fixed:
                self._to = sender
            got.append((self.peers[0], data))

    def close(self) -> None:
        self._socket.close()


class TcpWire(Wire):
    """TCP server `tcpin` for several clients, as in ArduPilot SITL."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__()
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._server.setblocking(False)
        _bind(self._server, host, port, "tcpin")
        self._server.listen(8)
        self._clients: dict[Peer, socket.socket] = {}
        self.name = f"tcpin:{host}:{self._server.getsockname()[1]}"

    def poll(self) -> list[tuple[Peer, bytes]]:
        self._accept()
        got = []
        for peer, client in list(self._clients.items()):
            try:
                data = client.recv(65536)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            if data:
                got.append((peer, data))
            else:
                self._drop(peer)
        return got

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._server.accept()
            except (BlockingIOError, OSError):
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer = Peer(Outlet(client.send))
            self._clients[peer] = client
            self.peers.append(peer)

    def _drop(self, peer: Peer) -> None:
        peer.open = False
        self._clients.pop(peer).close()
        self.peers.remove(peer)

    def close(self) -> None:
        for client in self._clients.values():
            client.close()
        self._server.close()


class SerialWire(Wire):
    """Serial wire on a terminal device, such as one end of a pseudo-terminal."""

    def __init__(self, path: str) -> None:
        super().__init__()
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise WireError(f"{path}: {error.strerror}") from None
        if not os.isatty(self._file):  # a file must not be overwritten with telemetry
            os.close(self._file)
            raise WireError(f"{path}: not a serial device")
        tty.setraw(self._file)
        self.name = path
        self.peers.append(Peer(Outlet(lambda data: os.write(self._file, data))))

    def poll(self) -> list[tuple[Peer, bytes]]:
        try:
            data = os.read(self._file, 65536)
        except OSError:
            return []
        return [(self.peers[0], data)] if data else []

    def close(self) -> None:
        os.close(self._file)


class MemoryWire(Wire):
    """Wire inside the process: the other end writes with `send` and reads from `received`."""

    def __init__(self, name: str = "memory") -> None:
        super().__init__()
        self.name = name
        self.received: list[bytes] = []
        self._sent: list[bytes] = []
        self.peers.append(Peer(self.received.append))

    def send(self, data: bytes) -> None:
        """Put bytes on the wire towards the autopilot."""
        self._sent.append(data)

    def poll(self) -> list[tuple[Peer, bytes]]:
        got = [(self.peers[0], data) for data in self._sent]
        self._sent.clear()
        return got

    def close(self) -> None:
        self._sent.clear()


def open_wire(url: str) -> Wire:
    """Open a wire by URL: udpout:HOST:PORT, udpin:HOST:PORT, tcpin:HOST:PORT or a device path.

    Raises
    ------
    WireError
        The URL is malformed or the port in use.
    """
    if url.startswith("/"):
        return SerialWire(url)
    kind, _, address = url.partition(":")
    host, _, port = address.rpartition(":")
    if kind not in ("udpout", "udpin", "tcpin") or not host or not is_port(port):
        raise WireError(
            f"{url!r} is no MAVLink address: write udpout:HOST:PORT, udpin:HOST:PORT or tcpin:HOST:PORT"
        )
    return TcpWire(host, int(port)) if kind == "tcpin" else UdpWire(kind, host, int(port))


def is_port(text: str) -> bool:
    """Return whether a text is a valid port number."""
    return text.isascii() and text.isdecimal() and int(text) < 65536


def _resolved(sock: socket.socket, host: str, port: int, kind: str) -> str:
    """Resolve a name once, because a look-up per frame would block."""
    try:
        return socket.gethostbyname(host)
    except OSError as error:
        sock.close()
        raise WireError(f"{kind}:{host}:{port}: {error.strerror or error}") from None


def _bind(sock: socket.socket, host: str, port: int, kind: str) -> None:
    try:
        sock.bind((host, port))
    except OSError as error:
        sock.close()
        why = "the port is in use" if error.errno == errno.EADDRINUSE else str(error.strerror or error)
        raise WireError(f"{kind}:{host}:{port}: {why}") from None


class Router:
    """Router of messages between wires and the autopilot, like ArduPilot's.

    A message addressed to a system heard on a wire goes there; a broadcast goes to all other wires. Messages
    for this autopilot and broadcasts also go to the autopilot. With a key, every wire is signed.
    """

    def __init__(
        self,
        wires: list[Wire],
        rng: np.random.Generator,
        deliver: Callable[[Any, int], None],
        key: bytes | None = None,
    ) -> None:
        self.wires = wires
        self.key = key
        self.model = LinkModel()
        self._rng = rng
        self._deliver = deliver
        self._where: dict[tuple[int, int], Peer] = {}
        self._numbers: dict[Peer, int] = {}
        self._queue: list[tuple[int, int, Callable[[], None]]] = []
        self._order = 0
        self.now_ns = 0
        self.unsendable = 0

    def number(self, peer: Peer) -> int:
        """Return the link number of a peer; the number of a closed peer is reused."""
        if peer not in self._numbers:
            self._numbers = {known: n for known, n in self._numbers.items() if known.open}
            self._where = {who: known for who, known in self._where.items() if known.open}
            taken = set(self._numbers.values())
            self._numbers[peer] = next(n for n in count() if n not in taken)
            if self.key is not None:
                sign(peer.codec, self.key, self._numbers[peer])
        return self._numbers[peer]

    def peers(self) -> list[Peer]:
        return [peer for wire in self.wires for peer in wire.peers]

    def read(self, now_ns: int) -> None:
        """Process all arrived data, and delayed messages that are now due."""
        self.now_ns = now_ns
        while self._queue and self._queue[0][0] <= now_ns:
            heapq.heappop(self._queue)[2]()
        for wire in self.wires:
            for peer, data in wire.poll():
                self.number(peer)
                for message in peer.parse(self._spoilt(data)):
                    self._through(lambda p=peer, m=message: self._route(p, m))  # type: ignore[misc]

    def send(self, link: int | None, message: Any) -> None:
        """Send a message of the autopilot to one link or to all."""
        for peer in self.peers():
            if link is None or self.number(peer) == link:
                self.number(peer)
                if self.key is not None:
                    keep_time(peer.codec)
                try:
                    data = bytes(message.pack(peer.codec))
                except (struct.error, ValueError, OverflowError):  # a value that does not fit its field
                    self.unsendable += 1
                    continue
                peer.codec.seq = (peer.codec.seq + 1) % 256
                self._through(lambda p=peer, d=data: p.write(self._spoilt(d)))  # type: ignore[misc]

    def _through(self, act: Callable[[], None]) -> None:
        m = self.model
        if m.cut or (m.loss and self._rng.random() < m.loss):
            return
        times = 2 if m.duplicate and self._rng.random() < m.duplicate else 1
        for _ in range(times):
            if not (m.delay_s or m.jitter_s):
                act()
                continue
            wait = m.delay_s + abs(self._rng.normal(0, m.jitter_s)) if m.jitter_s else m.delay_s
            self._order += 1
            heapq.heappush(self._queue, (self.now_ns + round(wait * 1e9), self._order, act))

    def _spoilt(self, data: bytes) -> bytes:
        if not self.model.corrupt or self._rng.random() >= self.model.corrupt:
            return data
        spoilt = bytearray(data)
        spoilt[int(self._rng.integers(len(spoilt)))] ^= 1 << int(self._rng.integers(8))
        return bytes(spoilt)

    def _route(self, source: Peer, message: Any) -> None:
        sender = message.get_srcSystem(), message.get_srcComponent()
        if sender == (1, 1):
            return  # our own message, returned through a loop
        if sender not in self._where or self._where[sender] is not source:
            self._where[sender] = source
            self.number(source)
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        if system in (0, 1) and (system == 0 or component in (0, 1)):
            self._deliver(message, self.number(source))
        if (system, component) == (1, 1):
            return
        frame = bytes(message.get_msgbuf())
        for peer in self.peers():
            if peer is not source and self._wants(peer, system, component):
                peer.write(self._spoilt(frame))

    def _wants(self, peer: Peer, system: int, component: int) -> bool:
        if system == 0:
            return True
        return any(
            where is peer and known[0] == system and component in (0, known[1])
            for known, where in self._where.items()
        )

    def close(self) -> None:
        for wire in self.wires:
            wire.close()
