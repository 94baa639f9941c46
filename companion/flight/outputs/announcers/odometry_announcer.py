"""Announcements of an external odometry that begins, ends, or is not used."""

from __future__ import annotations

import asyncio
from typing import Protocol

from companion.flight.fusion.external_odometry.external_odometry import SILENT
from companion.flight.fusion.external_odometry.external_pose import Drop
from companion.flight.fusion.external_odometry.frame_alignment import NEEDS_WAY
from companion.flight.landing.situation import Severity
from companion.flight.outputs.announcers.lidar_announcer import Say, announce

LASTS_NS = 1_000_000_000  # before the end of it is told
AGAIN_NS = 60_000_000_000  # the same text is not told again sooner
# Not used yet, and nothing is wrong.
WAITS = frozenset({NEEDS_WAY, Drop.WITHOUT_POSE.words})


class Told(Protocol):
    """An external odometry."""

    def why_not(self, now_ns: int) -> str:
        """Return why it is not used now, empty while it is."""


class OdometryAnnouncer:
    """Compares the use of the odometry with what was announced.

    Nothing is announced before its first message: it may begin later.

    Parameters
    ----------
    odometry
        None without one.
    say
        Sends a text with its severity.
    """

    def __init__(self, odometry: Told | None, say: Say) -> None:
        self._odometry, self._say = odometry, say
        self._used = False
        self._heard = False
        self._since_ns: int | None = None
        self._told_ns: dict[str, int] = {}

    async def run(self) -> None:
        """Announce changes until cancelled."""
        if self._odometry is None:
            await asyncio.get_running_loop().create_future()
        await announce(self.update, self._say)

    def update(self, at_ns: int) -> list[tuple[Severity, str]]:
        """Return severity and text of each change."""
        why = "" if self._odometry is None else self._odometry.why_not(at_ns)
        self._heard = self._heard or why != SILENT
        if self._odometry is None or not self._heard:
            return []
        if why == "":
            self._since_ns = None
            return [] if self._used else self._begin(at_ns)
        if self._since_ns is None:
            self._since_ns = at_ns
        if at_ns - self._since_ns < LASTS_NS or (why in WAITS and not self._used):
            return []
        self._used = False
        text = f"SLZ: odometry not used: {why}"
        return self._once(Severity.WARNING, text, at_ns)

    def _begin(self, at_ns: int) -> list[tuple[Severity, str]]:
        self._used = True
        text = "SLZ: odometry used: the map follows it"
        return self._once(Severity.INFO, text, at_ns)

    def _once(self, severity: Severity, text: str, at_ns: int) -> list[tuple[Severity, str]]:
        told_ns = self._told_ns.get(text)
        if told_ns is not None and at_ns - told_ns < AGAIN_NS:
            return []
        self._told_ns[text] = at_ns
        return [(severity, text)]
