"""Faults of the flight: the pilot's stick, the autopilot's failsafes, wind; and a start below a height."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.radio_receiver import AT_REST, PITCH, ROLL
from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

DEFLECTION_US = (150.0, 400.0)
LOW_V = (9.6, 10.4)
FENCES = ("FENCE_ALT_MAX", "FENCE_RADIUS")
SHARE = (0.3, 0.9)
RETURN = 2.0
# Direction, speed and vertical speed: not numbers, endless, negative, faster than any wind on Earth.
ABSURD = (
    (math.nan, math.nan, math.nan),
    (90.0, math.inf, 0.0),
    (math.nan, 5.0, 0.0),
    (0.0, -4.0, 0.0),
    (180.0, 200.0, 0.0),
    (1e30, 3.0, 0.0),
)
ABOVE_M = 0.5
SINKING_MS = 0.1


class PilotStick(Fault):
    """Deflection of the transmitter's roll or pitch stick, held and released at the end."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._channel = (ROLL, PITCH)[int(rng.integers(2))]
        sign = 1 if rng.random() < 0.5 else -1
        self._pulse_us = AT_REST[self._channel] + sign * round(float(rng.uniform(*DEFLECTION_US)))

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.receiver.transmitter[self._channel] = self._pulse_us

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.receiver.transmitter[self._channel] = AT_REST[self._channel]


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


class WindMissing(Fault):
    """The autopilot sends no WIND."""

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = lambda _message: None

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = None


class WindAbsurd(Fault):
    """Impossible numbers in WIND, in turn."""

    def __init__(self) -> None:
        self._numbers = itertools.cycle(ABSURD)

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = self._spoilt

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.wind.alter = None

    def _spoilt(self, _message: Any) -> Any:
        return mavlink.MAVLink_wind_message(*next(self._numbers))


class BelowHeight:
    """Hook of `Simulation.every_tick` that starts a fault when the vehicle sinks below a height, for good.

    The vehicle must have been half a metre above it before. The height is true, above the ground below.
    """

    def __init__(self, fault: Fault, height_m: float) -> None:
        self.fault, self.height_m = fault, height_m
        self.has_begun = False
        self._was_above = False

    def __call__(self, simulation: Simulation) -> None:
        if not self.has_begun:
            self._look(simulation)
        else:
            self.fault.on_tick(simulation)

    def _look(self, simulation: Simulation) -> None:
        truth = simulation.vehicle.truth
        east, north, up = (float(v) for v in truth.pos_enu_m)
        over_m = up - simulation.scene.world.height_below_m(east, north, up)
        self._was_above = self._was_above or over_m > self.height_m + ABOVE_M
        if self._was_above and over_m < self.height_m and truth.vel_enu_ms[2] < -SINKING_MS:
            self.has_begun = True
            self.fault.start(simulation)
