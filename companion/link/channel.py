"""One opened way to the autopilot: a socket or a serial port, until it is lost."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Protocol

OnBytes = Callable[[bytes], None]

# A stalled peer must cost memory and delay only up to here; what comes on top is dropped and counted.
MAX_BACKLOG_BYTES = 16_384


class Channel(Protocol):
    """An open channel. `lost` is done when it can no longer be used, with the reason as its result."""

    lost: asyncio.Future[str]

    def write(self, data: bytes) -> bool:
        """Send; return whether the data was taken."""

    def close(self) -> None:
        """Close after what is queued has been sent; `lost` follows."""


class StreamChannel(asyncio.Protocol):
    """TCP stream as a channel; an asyncio protocol."""

    def __init__(self, on_bytes: OnBytes) -> None:
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._on_bytes = on_bytes
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport

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
        if transport.get_write_buffer_size() > MAX_BACKLOG_BYTES:
            return False
        transport.write(data)
        return True

    def close(self) -> None:
        if self._transport is None:
            self.connection_lost(None)
        else:
            self._transport.close()
