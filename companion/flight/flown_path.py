"""Flown path of the vehicle, and a log line when its autopilot is lost or found again."""

from __future__ import annotations

import logging
from collections.abc import Callable

from companion.flight.landing.situation import Situation, Vector
from companion.runtime.ring_buffer import RingBuffer

log = logging.getLogger(__name__)

STEP_NS = 200_000_000
MOST = 20_000


class FlownPath:
    """Follows the vehicle.

    Attributes
    ----------
    enu_m
        Places, (n, 3) of the map frame, five a second; the newest 20,000.
    """

    def __init__(self) -> None:
        self.enu_m = RingBuffer(MOST, (3,))
        self._last_ns = 0
        self._was_lost = False

    def move(self, moved: Callable[[Vector], Vector]) -> None:
        """Convert the places, (n, 3), to another map frame."""
        places = self.enu_m.array()
        self.enu_m.clear()
        for place in moved(places) if len(places) else ():
            self.enu_m.append(place)

    def follow(self, situation: Situation, heard_ever: bool) -> None:
        """Add the place of this moment. heard_ever: an autopilot was heard before."""
        if situation.position_enu_m is not None and situation.now_ns - self._last_ns >= STEP_NS:
            self._last_ns = situation.now_ns
            self.enu_m.append(situation.position_enu_m)
        lost = not situation.connected and heard_ever
        if lost != self._was_lost:
            self._was_lost = lost
            log.warning("autopilot lost" if lost else "autopilot is back")
