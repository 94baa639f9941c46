"""Truth of what crosses a landing point: where it was, and whether orders came late or without need."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sitl.intruders import Intruder
from tests.e2e.harness import Mission

FASTEST_MS, SLOWEST_MS = 1.5, 0.4  # sink rates down to the touchdown
AFTER_S = 2.0  # the touchdown, during which nobody may be there
BERTH_M = 1.5  # beside the footprint, within which a landing is rightly not made
OVER_M = 3.0  # over what crosses, below which a vehicle that has no order yet is late
STEP_NS = 50_000_000


@dataclass(frozen=True, slots=True)
class Moment:
    """Situation at a time: distance of the object's middle from the point, and height over the ground, m."""

    t_s: float
    away_m: float
    height_m: float
    aborts: int
    waits: int


class CrossingWitness:
    """Looks on beside the intruders of a simulation, whose list it joins."""

    arrived = True

    def __init__(self, mission: Mission, intruder: Intruder) -> None:
        self._mission, self._intruder = mission, intruder
        self._next_ns = 0
        self.moments: list[Moment] = []
        p = mission.parameters
        self._footprint_m = max(p.footprint_m, p.greatest_dimension_m) / 2
        self._radius_m = self._top_m = 0.0

    def on_tick(self, s: object) -> None:
        """Take down a moment, from when the object starts."""
        m, one = self._mission, self._intruder
        if one.started_ns is None or m.sim.now_ns < self._next_ns:
            return
        self._next_ns = m.sim.now_ns + STEP_NS
        mover = m.sim.scene.world.movers[one.what]
        west, south, _, east, north, top = np.array([part.bounds() for part in mover.parts]).T
        self._radius_m = float(np.hypot(np.maximum(-west, east), np.maximum(-south, north)).max())
        self._top_m = float(top.max())
        tally, frame, estimate = (
            m.companion.executive.tally,
            m.companion.sensing.history.frame,
            m.sim.autopilot.estimate,
        )
        goal = np.array([*one.goal, 0.0])
        if tally.chosen_enu_m is not None and frame is not None and estimate is not None:
            drift = m.sim.vehicle.truth.pos_enu_m - estimate.pos_enu_m
            goal = m.sim.autopilot.enu_m(*frame.lla(tally.chosen_enu_m)) + drift
        away_m = math.hypot(mover.x_m - goal[0], mover.y_m - goal[1])
        waits = sum("crossing: waiting" in text for text in m.heard)
        self.moments.append(
            Moment(m.sim.now_ns * 1e-9, away_m, m.height_m if m.sim.autopilot.airborne else 0.0,
                   tally.aborts, waits)
        )  # fmt: skip

    def figures(self) -> dict[str, float | bool | int | None]:
        """Return what became of the crossing.

        late: the object came into the footprint while the vehicle, lower than `OVER_M` over it, had no order
        to wait or to break off. needless: aborts after which the object would not have been within the
        footprint and `BERTH_M` around at any time from now to the touchdown.
        """
        inside = self._footprint_m + self._radius_m
        ordered = entered = None
        needless, before = 0, Moment(0.0, math.inf, 0.0, 0, 0)
        for k, now in enumerate(self.moments):
            if k == 0:
                before = now
            if ordered is None and (now.aborts > before.aborts or now.waits > before.waits):
                ordered = now
            if entered is None and now.away_m < inside and 0 < now.height_m < self._top_m + OVER_M:
                entered = now
            if now.aborts > before.aborts and self._is_needless(k):
                needless += 1
            before = now
        late = entered is not None and (ordered is None or ordered.t_s > entered.t_s + 0.1)
        return {
            "late": late,
            "needless": needless,
            "waits": before.waits,
            "ordered_away_m": None if ordered is None else round(ordered.away_m, 2),
            "ordered_height_m": None if ordered is None else round(ordered.height_m, 2),
            "entered_height_m": None if entered is None else round(entered.height_m, 2),
        }

    def _is_needless(self, k: int) -> bool:
        now = self.moments[k]
        until_s = now.t_s + now.height_m / SLOWEST_MS + AFTER_S
        later = [one.away_m for one in self.moments[k:] if one.t_s <= until_s]
        return min(later) > self._footprint_m + self._radius_m + BERTH_M
