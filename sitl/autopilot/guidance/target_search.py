"""Actions of a landing whose target is lost or was never seen (AC_PrecLand_StateMachine.cpp)."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.guidance.precland import PrecisionLanding, Sight

F64 = NDArray[np.float64]

NEAR_M = 0.75
"""Distance at which a retry has reached its place."""
ABOVE_M = 1.5
"""Height of a retry above the vehicle's place at the newest measurement."""
HOVER_NS = 7_000_000_000
LAND, RETRY, HOVER = range(3)
"""Values of PLND_STRICT."""
TO_TARGET = 1
"""Value of PLND_RET_BEHAVE; 0 is the vehicle's place when the target was in sight."""


class Lost(Enum):
    """Steps after the loss of the target."""

    BEGINS = auto()
    SINKS = auto()
    RETRIES = auto()
    LANDS = auto()


class Retry(Enum):
    """Steps of a retry."""

    BEGINS = auto()
    CLIMBS = auto()
    SINKS = auto()
    COMPLETE = auto()


class Action(Enum):
    """Action of the landing: sink over target or place, hover there, or fly to the place of a retry."""

    SINK = auto()
    HOVER = auto()
    FLY = auto()


class TargetSearch:
    """State machine of one mode; a target found again or out of range resets all but the count of retries."""

    def __init__(self, precland: PrecisionLanding, parameters: Mapping[str, float]) -> None:
        self.precland, self._p = precland, parameters
        self.restart()

    def restart(self) -> None:
        """Begin a new mode."""
        self._retries = 0
        self._reset()

    def _reset(self) -> None:
        self._lost, self._retry = Lost.BEGINS, Retry.BEGINS
        self._hover_since_ns: int | None = None

    def act(self, place_enu_m: F64, now_ns: int) -> tuple[Action, F64]:
        """Return the action now, and the place (3,) to fly to with FLY."""
        sight = self.precland.sight
        if sight is Sight.RECENTLY_LOST:
            return self._after_loss(place_enu_m, now_ns)
        if sight is Sight.NEVER_SEEN:
            return self._without_target(now_ns), place_enu_m
        self._reset()
        return Action.SINK, place_enu_m

    def _after_loss(self, place_enu_m: F64, now_ns: int) -> tuple[Action, F64]:
        """Sink for PLND_TIMEOUT, then retry (get_target_lost_actions)."""
        if self._lost is Lost.BEGINS:
            self._lost = Lost.SINKS if self._p["PLND_STRICT"] >= RETRY else Lost.LANDS
        elif self._lost is Lost.SINKS:
            if now_ns - self.precland.valid_ns >= self._p["PLND_TIMEOUT"] * 1e9:
                self._lost, self._retry = Lost.RETRIES, Retry.BEGINS
        elif self._lost is Lost.RETRIES:
            return self._fly_retry(place_enu_m, now_ns)
        return Action.SINK, place_enu_m

    def _fly_retry(self, place_enu_m: F64, now_ns: int) -> tuple[Action, F64]:
        """Fly back to where the target was in sight, and sink to that height (retry_landing)."""
        most = self._p["PLND_RET_MAX"]
        if most == 0 or self._retries > most or self._retry is Retry.COMPLETE:
            return self._without_target(now_ns), place_enu_m
        to_target = self._p["PLND_RET_BEHAVE"] == TO_TARGET
        seen = self.precland.seen_enu_m if to_target else self.precland.vehicle_enu_m
        place = seen + np.array([0.0, 0.0, ABOVE_M])
        if self._retry is Retry.BEGINS:
            self._retries += 1
            self._retry = Retry.CLIMBS
            if self._retries <= most:
                self.precland.announce("PrecLand: Retrying")
        elif self._retry is Retry.CLIMBS:
            if float(np.sqrt(np.sum(np.square(place - place_enu_m)))) < NEAR_M:
                self._retry = Retry.SINKS
        else:
            place = np.array([*place_enu_m[:2], seen[2]])
            if abs(float(seen[2] - place_enu_m[2])) < NEAR_M:
                self._retry = Retry.COMPLETE
                self.precland.announce("PrecLand: Retry Completed")
        return Action.FLY, place

    def _without_target(self, now_ns: int) -> Action:
        """Hover as long as PLND_STRICT demands (get_failsafe_actions)."""
        if self._hover_since_ns is None:
            self._hover_since_ns = now_ns
            self.precland.announce("PrecLand: Failsafe Measures")
        if self._p["PLND_STRICT"] == HOVER:
            return Action.HOVER
        waits = self._p["PLND_STRICT"] == RETRY and now_ns - self._hover_since_ns < HOVER_NS
        return Action.HOVER if waits else Action.SINK
