"""Reconnecting transport to the autopilot."""

from __future__ import annotations

import asyncio
import errno
import logging
from collections.abc import Awaitable, Callable

from companion.flight.link.transport.channel import Channel, OnBytes
from companion.flight.link.transport.mavlink_url import Url
from companion.flight.link.transport.serial_port import open_serial
from companion.flight.link.transport.tcp import listen_tcp, open_tcp
from companion.flight.link.transport.udp import open_udpin, open_udpout
from companion.runtime.errors import UsageError

log = logging.getLogger(__name__)

FIRST_RETRY_S = 0.5
LONGEST_RETRY_S = 5.0
FLUSH_S = 0.5

_OPENERS: dict[str, Callable[[Url, OnBytes], Awaitable[Channel]]] = {
    "udpin": open_udpin,
    "udpout": open_udpout,
    "tcp": open_tcp,
    "tcpin": listen_tcp,
    "serial": open_serial,
}


class Transport:
    """Byte transport for one URL that reopens a lost channel.

    Attributes
    ----------
    up
        Whether a channel is open (for UDP that says nothing about the other side).
    opened, dropped
        Number of channels opened so far; number of writes that no channel accepted.
    """

    def __init__(self, url: Url) -> None:
        self.url = url
        self.opened = 0
        self.dropped = 0
        self._channel: Channel | None = None
        self._heard = False
        self._failures = 0

    @property
    def up(self) -> bool:
        return self._channel is not None

    def write(self, data: bytes) -> None:
        """Send, or drop and count: no message on this link is worth sending late."""
        if self._channel is None or not self._channel.write(data):
            self.dropped += 1

    async def run(
        self,
        on_bytes: OnBytes,
        on_up: Callable[[], None] = lambda: None,
        on_down: Callable[[str], None] = lambda reason: None,
    ) -> None:
        """Open, read, and reopen with a growing pause, until cancelled.

        Raises
        ------
        UsageError
            If the first attempt fails and waiting would not help: a port in use, an address that is not this
            machine's, a device without permission.
        """

        def receive(data: bytes) -> None:
            self._heard = True
            on_bytes(data)

        while True:
            channel = await self._open(receive)
            if channel is not None:
                self._channel, self._heard = channel, False
                self.opened += 1
                on_up()
                try:
                    # Our cancellation must not cancel `lost`, or the channel could no longer report its end.
                    reason = await asyncio.shield(channel.lost)
                finally:
                    self._channel = None
                    await _close(channel)
                if self._heard:
                    self._failures = 0
                log.warning("%s: lost: %s", self.url, reason)
                on_down(reason)
            pause_s = min(FIRST_RETRY_S * 2**self._failures, LONGEST_RETRY_S)
            self._failures = min(self._failures + 1, 8)
            await asyncio.sleep(pause_s)

    async def _open(self, on_bytes: OnBytes) -> Channel | None:
        try:
            return await _OPENERS[self.url.kind](self.url, on_bytes)
        except UnicodeError:
            raise UsageError(f"{self.url}: no host has such a name") from None
        except (OSError, TimeoutError) as error:
            if self.opened == self._failures == 0 and (line := _hopeless(self.url, error)):
                raise UsageError(line) from None
            if self._failures == 0:
                log.warning("%s: %s; trying again", self.url, error or "no answer")
            return None


async def _close(channel: Channel) -> None:
    """Close, and wait briefly for queued data to be sent."""
    channel.close()
    try:
        async with asyncio.timeout(FLUSH_S):
            await asyncio.shield(channel.lost)
    except TimeoutError:
        log.debug("a channel did not close in time")


def _hopeless(url: Url, error: OSError) -> str | None:
    """Return the error for the user if no retry can help."""
    if url.kind in ("udpin", "tcpin"):
        if error.errno == errno.EADDRINUSE:
            return f"{url}: port {url.port} is in use; stop the other program or choose another port"
        return f"{url}: this machine cannot listen there ({error.strerror or error})"
    if error.errno in (errno.EACCES, errno.EPERM):
        advice = "; add the user to the group 'dialout'" if url.kind == "serial" else ""
        return f"{url}: permission denied{advice}"
    if url.kind == "serial" and error.errno in (errno.EAGAIN, errno.EBUSY):
        return f"{url}: another program has the port open; stop it"
    if url.kind == "serial" and error.errno in (errno.EISDIR, errno.ENOTTY):
        return f"{url}: not a serial device"
    return None
