"""The executive's loop: 20 times a second from what is known to commands, and their execution."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable

from companion.flight.command_execution import CommandExecution
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.landing.executive import Executive
from companion.flight.landing.restart import Restart
from companion.flight.landing.situation import COMMANDING, Severity, Situation, Vector
from companion.flight.link.link import Link
from companion.flight.scan_feed import ScanFeed
from companion.flight.situation_source import SituationSource
from companion.runtime.event import Event
from companion.runtime.ring_buffer import RingBuffer
from slz import LocalFrame

log = logging.getLogger(__name__)

STEP_S = 0.05


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


class DecisionLoop:
    """Steps the executive, in a map frame whose origin is near.

    Attributes
    ----------
    on_new_frame
        Event of another map frame, which has begun.
    """

    def __init__(
        self,
        link: Link,
        history: PoseHistory,
        feed: ScanFeed,
        executive: Executive,
        situations: SituationSource,
        execution: CommandExecution,
        restart: Restart,
        path: FlownPath,
    ) -> None:
        self._link, self._history, self._feed = link, history, feed
        self._executive, self._situations, self._execution = executive, situations, execution
        self._restart, self._path = restart, path
        self.on_new_frame: Event[[LocalFrame]] = Event()
        self._hurry = asyncio.Event()

    async def run(self, stop: asyncio.Event) -> None:
        """Step until stopped: the last setpoint is that of whoever stops it."""
        loop = asyncio.get_running_loop()
        next_s = loop.time()
        while not stop.is_set():
            self.run_once()
            next_s = max(next_s + STEP_S, loop.time())
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(next_s):
                    await self._hurry.wait()
                    next_s = loop.time()  # the step after this one is due a whole step from now
            self._hurry.clear()

    def hurry(self) -> None:
        """Take the next step now."""
        self._hurry.set()

    def run_once(self) -> None:
        """Step the executive once and carry out its commands."""
        self._feed.follow_jumps()  # before the executive selects the point again, in the new map
        self._feed.warn_of_attitudes()
        if self.begin_frame_if_far():
            self._feed.begin_frame()
        situation, vehicle = self._situations.situation(), self._link.vehicle
        commands = self._executive.step(situation)
        self._restart.update(situation, self._executive, self._history.frame, vehicle.sysid, vehicle.boot_ms)
        self._execution.execute(commands, situation)
        self._path.follow(situation, heard_ever=vehicle.sysid is not None)

    def begin_frame_if_far(self) -> bool:
        """Begin another map frame if the vehicle is far from the origin; return whether one began.

        Selected point, chosen point and flown path are converted to the new frame; the new map requests the
        survey prior again. Between hand-over and landing the frame is kept: a landing stays within a survey's
        reach.
        """
        history, old = self._history, self._history.frame
        if old is None or self._executive.phase in COMMANDING or not history.is_far:
            return False
        new = history.begin_frame()

        def moved(enu_m: Vector) -> Vector:
            return new.enu_m(*old.lla(enu_m).T)

        self.on_new_frame.emit(new)
        self._executive.change_frame(moved)
        self._path.move(moved)
        log.warning("a new map frame begins at %.7f, %.7f", new.lat_deg, new.lon_deg)
        self._link.statustext("SLZ: far from the map's origin: mapping anew", Severity.INFO.value)
        return True
