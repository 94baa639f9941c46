"""Hazard that comes to the landing point: its shape, place and moment are those of a scenario."""

from __future__ import annotations

import math

from sitl.intruders.intruder import Intruder, SimulatedFlight
from sitl.world.primitives import Box, Ellipsoid, Kind
from tests.search.scenario import Scenario

FROM_M = 5.0
IN_WAY_M = 1.0  # from the landing point to its side: what stops beside is answered late by itself
POST_M = 0.3  # side of a post: so few pulses seldom hit a thinner one


class Hazard(Intruder):
    """Object that slides in from `FROM_M` before its place, which is aside of the ordered point.

    Parameters
    ----------
    ordered_en_m
        East and north of the ordered point, as the autopilot knows them. A hazard beside the landing target
        would move with a target that is wrong, and never be met. None: beside the landing target.

    Attributes
    ----------
    parts
        Boxes and balls about its own origin.
    """

    what = "hazard"
    end = "has stopped"

    def __init__(self, scenario: Scenario, ordered_en_m: tuple[float, float] | None) -> None:
        super().__init__(scenario.number("hazard_below_m"))
        self._ordered_en_m = ordered_en_m
        self.parts = (_shape(scenario),)
        self._aside_m = scenario.number("hazard_aside_m")
        self._is_in_way = self._aside_m - self.parts[0].bounds()[3] < IN_WAY_M
        self._aside_rad = math.radians(scenario.number("hazard_aside_deg"))
        self._from_rad = math.radians(scenario.number("hazard_from_deg"))
        self._speed_ms = scenario.number("hazard_speed_ms")

    def late_ns(self, reacted_ns: int) -> int | None:
        """Return the time from its arrival to an answer, below zero while it comes.

        None if it had not started, or does not stop where the vehicle comes down.
        """
        if self.started_ns is None or reacted_ns < self.started_ns or not self._is_in_way:
            return None
        return reacted_ns - self.started_ns - round(FROM_M / self._speed_ms * 1e9)

    def start(self, s: SimulatedFlight) -> None:
        known = s.autopilot.estimate
        if self._ordered_en_m is not None and known is not None:
            off_m = s.vehicle.truth.pos_enu_m - known.pos_enu_m
            self.goal = self._ordered_en_m[0] + float(off_m[0]), self._ordered_en_m[1] + float(off_m[1])
        s.scene.world.add_mover(self.what, self.parts, *self._at(FROM_M), 0.0)

    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        left_m = max(0.0, FROM_M - self._speed_ms * since_s)
        s.scene.world.move(self.what, *self._at(left_m), 0.0)
        return left_m == 0.0

    def _at(self, left_m: float) -> tuple[float, float]:
        """Return east and north, so far from its place."""
        x, y = self.goal
        x += self._aside_m * math.sin(self._aside_rad) + left_m * math.sin(self._from_rad)
        y += self._aside_m * math.cos(self._aside_rad) + left_m * math.cos(self._from_rad)
        return x, y


def _shape(scenario: Scenario) -> Box | Ellipsoid:
    size, height = scenario.number("hazard_size_m"), scenario.number("hazard_height_m")
    match scenario.text("hazard"):
        case "ball":
            radius = min(size, height) / 2
            return Ellipsoid(0.0, 0.0, radius, radius, radius, radius, Kind.WOOD, "ball")
        case "post":
            return Box(0.0, 0.0, 0.0, POST_M, POST_M, height, kind=Kind.WOOD, name="post")
    return Box(0.0, 0.0, 0.0, size, size, height, kind=Kind.WOOD, name="box")
