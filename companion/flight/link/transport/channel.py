"""Transport channel to the autopilot: an open socket or serial port, until it is lost."""

from __future__ import annotations

import asyncio
import fcntl
import socket
import struct
import sys
import termios
from collections.abc import Callable
from time import monotonic
from typing import Any, Protocol

OnBytes = Callable[[bytes], None]

# Bound on the memory and delay caused by a stalled peer; further data is dropped and counted.
MAX_BACKLOG_BYTES = 16_384
# TCP delivers everything, however late, so this bounds the data in transit: half a second of what we send. A
# signed batch of OBSTACLE_DISTANCE_3D is 2.4 KiB.
MAX_UNACKNOWLEDGED_BYTES = 4096
# A stream without acknowledgement for this long is reset, because its data must not arrive any more.
STALLED_S = 1.0
# The kernel gives a stream up after this time if we write nothing more: a pulled cable sends no reset.
UNACKNOWLEDGED_MS = 2000
# Bounds the data queued in the kernel where it does not report the amount; Linux doubles the value.
SEND_BUFFER_BYTES = 8192


class Channel(Protocol):
    """Open channel; `lost` completes when it can no longer be used, with the reason as its result."""

    lost: asyncio.Future[str]

    def write(self, data: bytes) -> bool:
        """Send; return whether the data was accepted."""

    def close(self) -> None:
        """Close after the queued data is sent; `lost` follows."""


class StreamChannel(asyncio.Protocol):
    """TCP stream as a channel; an asyncio protocol.

    It is reset once the peer has acknowledged nothing for a second of real (kernel) time.
    """

    def __init__(self, on_bytes: OnBytes) -> None:
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._on_bytes = on_bytes
        self._transport: Any = None
        self._written = 0
        self._acknowledged = 0
        self._acknowledged_s = 0.0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport
        raw = transport.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)

    def data_received(self, data: bytes) -> None:
        self._on_bytes(data)

    def eof_received(self) -> bool:
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.lost.done():
            self.lost.set_result(str(exc) if exc else "closed by the other side")

    def write(self, data: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        waiting = transport.get_write_buffer_size() + _unacknowledged(transport.get_extra_info("socket"))
        if self._stalled(waiting):
            self._reset(f"nothing acknowledged for {STALLED_S:g} s")
            return False
        if waiting > MAX_UNACKNOWLEDGED_BYTES:
            return False
        transport.write(data)
        self._written += len(data)
        return True

    def close(self) -> None:
        if self._transport is None:
            self.connection_lost(None)
        else:
            self._transport.close()

    def _stalled(self, waiting: int) -> bool:
        acknowledged = self._written - waiting
        if waiting == 0 or acknowledged > self._acknowledged:
            self._acknowledged, self._acknowledged_s = acknowledged, monotonic()
        return monotonic() - self._acknowledged_s > STALLED_S

    def _reset(self, reason: str) -> None:
        """Abort the stream and discard its queued data, also in the kernel."""
        self.connection_lost(ConnectionError(reason))
        linger = struct.pack("ii", 1, 0)
        self._transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self._transport.abort()


def _unacknowledged(raw: socket.socket) -> int:
    """Return the number of bytes in the kernel, unsent or unacknowledged; 0 where it does not report them."""
    if sys.platform != "linux":
        return 0
    return int.from_bytes(fcntl.ioctl(raw.fileno(), termios.TIOCOUTQ, bytes(4)), sys.byteorder)  # SIOCOUTQ
