"""Intruder: a car that drives onto the landing target during the descent."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.modes import Mode
from sitl.scenes.scene import Scene
from sitl.truth.flight_log import FlightLog
from sitl.vehicle.multirotor import Vehicle

SPEED_MS = 6.0
FROM_M = 25.0
HIGHEST_M = 200.0  # above this height, the start of the car is of no use


class SimulatedFlight(Protocol):
    """See `Simulation`."""

    scene: Scene
    vehicle: Vehicle
    autopilot: Autopilot
    log: FlightLog

    @property
    def now_ns(self) -> int: ...


class Intruder:
    """Car that drives from 25 m away onto the latest LANDING_TARGET once the vehicle is low enough."""

    def __init__(self, below_m: float) -> None:
        self.below_m = below_m
        self.started_ns: int | None = None
        self.arrived = False
        self._goal = (0.0, 0.0)
        self._bearing = 0.0
        self._next_ns = 0

    def on_tick(self, simulation: SimulatedFlight) -> None:
        """Move the car, or check the condition for its start."""
        s = simulation
        if self.started_ns is None:
            self._watch(s)
            return
        if self.arrived or s.now_ns < self._next_ns:
            return
        self._next_ns = s.now_ns + 50_000_000
        left = max(0.0, FROM_M - SPEED_MS * (s.now_ns - self.started_ns) * 1e-9)
        x = self._goal[0] + left * math.cos(self._bearing)
        y = self._goal[1] + left * math.sin(self._bearing)
        s.scene.world.move("intruder", x, y, self._bearing + math.pi)
        if left == 0.0:
            self.arrived = True
            s.log.events.append({"t": s.now_ns * 1e-9, "event": "car on the landing point", "e": x, "n": y})

    def _watch(self, s: SimulatedFlight) -> None:
        target, estimate = s.autopilot.landing_target_enu_m, s.autopilot.estimate
        if target is None or estimate is None or not s.autopilot.airborne:
            return
        if s.autopilot.mode not in (Mode.LAND, Mode.GUIDED):
            return
        truth = s.vehicle.truth.pos_enu_m
        if truth[2] - s.scene.world.height_m(float(truth[0]), float(truth[1])) > self.below_m:
            return
        goal = target + truth - estimate.pos_enu_m
        self._goal = float(goal[0]), float(goal[1])
        self._bearing = self._clear_way(s)
        x = self._goal[0] + FROM_M * math.cos(self._bearing)
        y = self._goal[1] + FROM_M * math.sin(self._bearing)
        s.scene.world.add_car("intruder", x, y, self._bearing + math.pi)
        self.started_ns = s.now_ns
        s.log.events.append({"t": s.now_ns * 1e-9, "event": "car starts", "e": x, "n": y})

    def _clear_way(self, s: SimulatedFlight) -> float:
        """Return the bearing along which the ground towards the goal is most even."""
        bearings = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        along = np.linspace(0, FROM_M, 30)
        rough = []
        for bearing in bearings:
            z, _ = s.scene.world.surface(
                self._goal[0] + along * np.cos(bearing), self._goal[1] + along * np.sin(bearing)
            )
            rough.append(float(np.nan_to_num(np.ptp(z), nan=1e3)))
        return float(bearings[int(np.argmin(rough))])
