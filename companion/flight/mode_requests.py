"""Requests for the vehicle's flight mode: repeated until reached, given up when no longer wanted."""

from __future__ import annotations

import asyncio
import logging

from companion.flight.landing.executive import Executive
from companion.flight.landing.situation import COMMANDING, Phase, Severity, Situation
from companion.flight.link.link import Link
from companion.runtime.clock import now_ns

log = logging.getLogger(__name__)

ASK_AGAIN_S = 1.0  # for a mode that was refused
TELL_AGAIN_NS = 10_000_000_000  # of a mode that is still refused


class ModeRequests:
    """One request at a time, on behalf of the executive."""

    def __init__(self, link: Link, executive: Executive) -> None:
        self._link, self._executive = link, executive
        self._task: asyncio.Task[None] | None = None
        self._wanted = ""
        self._refusals = 0  # of modes asked for, one after the other
        self._refusal_reported_ns: int | None = None

    def request(self, kind: str) -> None:
        """Ask for the mode of a kind, "guided" or "land", unless it is being asked for."""
        pending = self._task is not None and not self._task.done()
        if pending and kind == self._wanted:
            return
        self._wanted = kind
        autopilot = self._link.vehicle.autopilot
        mode = autopilot.guided_mode if kind == "guided" else autopilot.landing_mode
        if mode is not None:
            self._task = asyncio.create_task(self._set_mode(mode), name="set-mode")

    def review(self, situation: Situation) -> None:
        """Give a request up that was reached or is not wanted, or whose mode the pilot may have chosen."""
        if not situation.heard or not self._is_wanted() or self._is_reached():
            self.cancel()

    def cancel(self) -> None:
        """Give the request up."""
        if self._task is not None:
            self._task.cancel()

    def _is_wanted(self) -> bool:
        """Return whether the mode is still wanted: a landing broken off must not come late."""
        phase = self._executive.phase
        return (phase is Phase.FINAL) == (self._wanted == "land") and phase in COMMANDING

    def _is_reached(self) -> bool:
        vehicle = self._link.vehicle
        return vehicle.guided if self._wanted == "guided" else vehicle.landing

    async def _set_mode(self, mode: str) -> None:
        result = await self._link.set_mode(mode)
        if result.ok:
            self._refusals = 0
        elif result.outcome != "superseded":
            log.warning("mode %s: %s", mode, result.outcome)
            self._tell_refusal(mode, now_ns())
            await asyncio.sleep(ASK_AGAIN_S)

    def _tell_refusal(self, mode: str, now: int) -> None:
        """Call the pilot when the second request for a mode fails: the first may have come too soon."""
        self._refusals += 1
        reported_ns = self._refusal_reported_ns
        if self._refusals > 1 and (reported_ns is None or now - reported_ns >= TELL_AGAIN_NS):
            self._refusal_reported_ns = now
            self._link.statustext(f"SLZ: {mode} refused: take over", Severity.CRITICAL.value)
            self._executive.on_refusal()
