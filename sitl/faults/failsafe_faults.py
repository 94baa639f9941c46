"""Triggers of the autopilot's own failsafes: lost GPS, low battery, lost radio, a breached fence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

LOW_V = (9.6, 10.4)
FENCES = ("FENCE_ALT_MAX", "FENCE_RADIUS")
SHARE = (0.3, 0.9)
RETURN = 2.0


class GpsLoss(Fault):
    """Loss of the GPS fix; the estimate drifts in a random direction."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._bearing_rad = float(rng.uniform(0.0, 2 * math.pi))

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.lose_gps(self._bearing_rad)

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.regain_gps()


class BatteryFailsafe(Fault):
    """Battery voltage below its limit, with the autopilot configured to return a second later."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._volts = float(rng.uniform(*LOW_V))

    def start(self, simulation: Simulation) -> None:
        autopilot = simulation.autopilot
        autopilot.parameters.update({"BATT_FS_LOW_ACT": RETURN, "BATT_LOW_TIMER": 1.0})
        autopilot.battery_sag_v += autopilot.battery_v - self._volts

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.battery_sag_v = 0.0


class RadioFailsafe(Fault):
    """Loss of the pilot's transmitter: the autopilot returns after a second."""

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.receiver.transmitting = False

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.receiver.transmitting = True


class FenceBreach(Fault):
    """Breach of a fence: a ceiling or a circle around home is tightened so that the vehicle is outside it."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._fence = FENCES[int(rng.integers(len(FENCES)))]
        self._share = float(rng.uniform(*SHARE))

    def start(self, simulation: Simulation) -> None:
        autopilot = simulation.autopilot
        estimate = autopilot.estimate
        if estimate is None:
            raise ValueError("fence breach: this simulation has not begun")
        east, north, up = (float(v) for v in estimate.pos_enu_m - autopilot.navigator.home_enu_m)
        reached_m = up if self._fence == "FENCE_ALT_MAX" else math.hypot(east, north)
        autopilot.parameters.update({"FENCE_ENABLE": 1.0, self._fence: self._share * reached_m})

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.parameters["FENCE_ENABLE"] = 0.0
