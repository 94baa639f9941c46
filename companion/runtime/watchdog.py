"""Service notifications to systemd (sd_notify(3)): ready, alive, stopping; no-op without systemd."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable, Mapping

log = logging.getLogger(__name__)


class Watchdog:
    """Client of the service manager's notification socket.

    Parameters
    ----------
    healthy
        Called before every sign of life; without one, the manager restarts the program.
    environment
        Holds NOTIFY_SOCKET, and WATCHDOG_USEC if signs of life are expected.
    """

    def __init__(self, healthy: Callable[[], bool], environment: Mapping[str, str] = os.environ) -> None:
        self._healthy = healthy
        self._address = environment.get("NOTIFY_SOCKET", "")
        within = environment.get("WATCHDOG_USEC", "")
        # Twice per time-out, as sd_watchdog_enabled(3) advises.
        self.period_s = int(within) / 2e6 if within.isascii() and within.isdigit() else None

    def ready(self) -> None:
        """Report that startup is complete."""
        self._say("READY=1")

    def stopping(self) -> None:
        """Report that the program is stopping."""
        self._say("STOPPING=1")

    async def run(self) -> None:
        """Send signs of life until cancelled, while the program is healthy."""
        was_healthy = True
        while self.period_s is not None:
            healthy = self._healthy()
            if healthy:
                self._say("WATCHDOG=1")
            elif was_healthy:
                log.error("the pipeline hangs: no more signs of life to systemd, which starts anew")
            was_healthy = healthy
            await asyncio.sleep(self.period_s)

    def _say(self, line: str) -> None:
        if not self._address:
            return
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as line_out:
                line_out.setblocking(False)
                line_out.sendto(line.encode(), address)
        except OSError as error:
            log.warning("systemd does not take %s: %s", line, error)
