"""Drift and fault of a scenario, each from when the vehicle sinks below a height."""

from __future__ import annotations

import math

import numpy as np

from sitl import faults
from sitl.faults import Fault, gps_faults
from sitl.simulation import Simulation
from tests.search.scenario import Scenario

DRIFT_BELOW_M = 5.5


class Spell:
    """Hook of `Simulation.every_tick`: a fault for some seconds once the vehicle sinks below a height."""

    def __init__(self, fault: Fault, below_m: float, lasts_s: float) -> None:
        self._begun = faults.BelowHeight(fault, below_m)
        self.lasts_ns, self._until_ns = lasts_s * 1e9, 0.0
        self._over = False
        self.begun_ns: int | None = None

    def __call__(self, simulation: Simulation) -> None:
        if self._over:
            return
        self._begun(simulation)
        if self._begun.has_begun:
            self.begun_ns = simulation.now_ns if self.begun_ns is None else self.begun_ns
            self._until_ns = self._until_ns or simulation.now_ns + self.lasts_ns
            self._over = simulation.now_ns >= self._until_ns
            if self._over:
                self._begun.fault.stop(simulation)


class Drift(gps_faults.GpsSlowDrift):
    """Drift of the GPS position in a given direction."""

    def __init__(self, speed_ms: float, to_deg: float) -> None:
        super().__init__(np.random.default_rng(0), speed_ms)
        towards = math.radians(to_deg)
        self._velocity_enu_ms = speed_ms * np.array([math.sin(towards), math.cos(towards), 0.0])


def troubles(scenario: Scenario, rng: np.random.Generator) -> dict[str, Spell]:
    """Return the hooks of a scenario's drift and fault, by name."""
    out = {}
    if scenario.number("drift_ms") > 0:
        drift = Drift(scenario.number("drift_ms"), scenario.number("drift_to_deg"))
        out["drift"] = Spell(drift, DRIFT_BELOW_M, math.inf)
    if (name := scenario.text("fault")) != "none":
        fault = faults.build(name, rng)
        out[name] = Spell(fault, scenario.number("fault_below_m"), scenario.number("fault_s"))
    return out
