"""Intruder: an object that comes to the landing point, once the vehicle is low."""

from __future__ import annotations

import abc
from typing import Protocol

import numpy as np

from sitl.autopilot.autopilot import Autopilot
from sitl.scenes.scene import Scene
from sitl.truth.flight_log import FlightLog
from sitl.vehicle.multirotor import Vehicle

HIGHEST_M = 200.0  # above this height, the start of an intruder is of no use
STEP_NS = 50_000_000


class SimulatedFlight(Protocol):
    """See `Simulation`."""

    scene: Scene
    vehicle: Vehicle
    autopilot: Autopilot
    log: FlightLog

    @property
    def now_ns(self) -> int: ...


class Intruder(abc.ABC):
    """An object that comes to the latest LANDING_TARGET once the vehicle is low enough.

    Attributes
    ----------
    what
        Its name in the world and in the log.
    end
        Its place at its end, in words for the log.
    below_m
        Height over the ground below which it starts, m.
    started_ns, arrived
        When it started, None before; whether it is at its end.
    goal
        Landing point when it started, true ENU, m.
    """

    what: str
    end = "on the landing point"

    def __init__(self, below_m: float, seed: int = 1) -> None:
        self.below_m = below_m
        self.rng = np.random.default_rng(seed)
        self.started_ns: int | None = None
        self.arrived = False
        self.goal = (0.0, 0.0)
        self._next_ns = 0

    @abc.abstractmethod
    def start(self, s: SimulatedFlight) -> None:
        """Put the object into the world."""

    @abc.abstractmethod
    def move(self, s: SimulatedFlight, since_s: float) -> bool:
        """Move the object by its own time, in seconds since its start; return True at its end."""

    def on_tick(self, s: SimulatedFlight) -> None:
        """Move the object, or check the condition for its start."""
        if self.started_ns is None:
            self._watch(s)
            return
        if self.arrived or s.now_ns < self._next_ns:
            return
        self._next_ns = s.now_ns + STEP_NS
        self.arrived = self.move(s, (s.now_ns - self.started_ns) * 1e-9)
        if self.arrived:
            self._write(s, f"{self.what} {self.end}")

    def _watch(self, s: SimulatedFlight) -> None:
        target, estimate = s.autopilot.landing_target_enu_m, s.autopilot.estimate
        if target is None or estimate is None or not s.autopilot.airborne:
            return
        if s.autopilot.mode not in s.autopilot.companion_modes:
            return
        truth = s.vehicle.truth.pos_enu_m
        if truth[2] - s.scene.world.height_m(float(truth[0]), float(truth[1])) > self.below_m:
            return
        goal = target + truth - estimate.pos_enu_m
        self.goal = float(goal[0]), float(goal[1])
        self.start(s)
        self.started_ns = s.now_ns
        self._write(s, f"{self.what} starts")

    def _write(self, s: SimulatedFlight, event: str) -> None:
        mover = s.scene.world.movers[self.what]
        s.log.events.append({"t": s.now_ns * 1e-9, "event": event, "e": mover.x_m, "n": mover.y_m})
