"""Where the mapped point truly is, and what the pilot is told when GPS is cut."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.flight.landing.situation import Phase
from companion.runtime.clock import now_ns
from sitl.simulation import Simulation
from tests.e2e.harness import Mission


class PlaceWitness:
    """Follows a flight: one of the simulator's functions of each tick.

    The chosen point is in coordinates that err, with the vehicle's own, when it is chosen; the point on the
    ground is where it then truly was.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._chosen: tuple[float, ...] | None = None
        self._true_m: NDArray[np.float64] | None = None
        self._cut_s: float | None = None
        self._told_s: float | None = None
        self._heard = 0
        self._went_on = False
        mission.sim.every_tick.append(self._look)

    @property
    def is_called(self) -> bool:
        """Whether the pilot was called to take over since GPS was cut."""
        return self._told_s is not None

    def figures(self) -> dict[str, float | bool | None]:
        """Return what came of it.

        world_error_m: from the touchdown to the mapped point, None without either. told_s: from the cut of
        GPS until the pilot is called to take over, None if not. went_on: the pilot was told that the
        landing goes on by the LiDAR.
        """
        contact, error_m = self._mission.sim.touchdown, None
        if contact is not None and self._true_m is not None:
            error_m = math.hypot(contact["e"] - self._true_m[0], contact["n"] - self._true_m[1])
        told_s = None if self._cut_s is None or self._told_s is None else self._told_s - self._cut_s
        return {"world_error_m": error_m, "told_s": told_s, "went_on": self._went_on}

    def _look(self, sim: Simulation) -> None:
        companion, home = self._mission.companion, sim.autopilot
        chosen, frame = companion.executive.tally.chosen_enu_m, companion.sensing.history.frame
        pose = companion.sensing.history.latest(now_ns())
        if pose is not None and frame is not None and chosen is not None and self._chosen != tuple(chosen):
            off = home.enu_m(*frame.lla(pose.position_enu_m)) - sim.vehicle.truth.pos_enu_m
            self._chosen, self._true_m = tuple(chosen), home.enu_m(*frame.lla(chosen)) - off
        flying = companion.executive.phase in (Phase.DESCEND, Phase.FINAL, Phase.APPROACH)
        now_s = sim.now_ns * 1e-9
        if self._cut_s is None and flying and not home.aiding.gps:
            self._cut_s, self._heard = now_s, len(self._mission.heard)
        if self._cut_s is not None:
            new = self._mission.heard[self._heard :]
            self._went_on |= any("going on by the LiDAR" in text for text in new)
            if self._told_s is None and any("take over" in text for text in new):
                self._told_s = now_s
