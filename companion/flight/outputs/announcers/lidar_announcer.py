"""Announcements of what is wrong with the LiDAR's stream or clock, once for each cause."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence

from companion.flight.landing.situation import Severity
from companion.flight.sensors.diagnosis.lidar_diagnosis import Episode, LidarDiagnosis
from companion.runtime.clock import now_ns

AGAIN_NS = 60_000_000_000  # the same cause is not told again sooner
LONGEST = 50


log = logging.getLogger(__name__)

STEP_S = 0.25

Say = Callable[[str, int], None]
Update = Callable[[int], Sequence[tuple[Severity, str]]]


async def announce(update: Update, say: Say) -> None:
    """Say and log each severity and text that `update` returns for the present time (ns), until cancelled."""
    while True:
        for severity, text in update(now_ns()):
            log.warning(text)
            say(text, severity.value)
        await asyncio.sleep(STEP_S)


class LidarAnnouncer:
    """Compares the causes that are present with those that were announced.

    Parameters
    ----------
    diagnosis
        Of the sensor's stream; None for a sensor without.
    say
        Sends a text with its severity.
    """

    def __init__(self, diagnosis: LidarDiagnosis | None, say: Say) -> None:
        self._diagnosis, self._say = diagnosis, say
        self._told: dict[str, Episode] = {}
        self._told_ns: dict[str, int] = {}

    async def run(self) -> None:
        """Announce changes until cancelled."""
        if self._diagnosis is None:
            await asyncio.get_running_loop().create_future()
        await announce(self.update, self._say)

    def update(self, at_ns: int) -> list[tuple[Severity, str]]:
        """Return severity and text of each cause that is new, and of each that is over."""
        news: list[tuple[Severity, str]] = []
        active = {} if self._diagnosis is None else {one.cause: one for one in self._diagnosis.active}
        for cause, episode in list(self._told.items()):
            if cause not in active:
                del self._told[cause]
                text = f"SLZ: over: {episode.explanation.text}"
                news.append((Severity.NOTICE, text[:LONGEST]))
        for cause, episode in active.items():
            told_ns = self._told_ns.get(cause)
            if cause not in self._told and (told_ns is None or at_ns - told_ns >= AGAIN_NS):
                self._told[cause], self._told_ns[cause] = episode, at_ns
                news.append((Severity.WARNING, f"SLZ: {episode.explanation.text}"))
        return news
