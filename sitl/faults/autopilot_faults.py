"""Autopilot faults: a reboot in flight, an estimate that moves, lost time, a pilot who takes over."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.aiding.source_sets import Source
from sitl.autopilot.pilot import Pilot
from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

F64 = NDArray[np.float64]

REBOOT_S = 2.0
JUMP_M = 5.0
BAROMETER_M = 3.0
DRIFT_MS, DRIFT_M = 0.3, 5.0
TICK_LIMIT_S = 0.1
SWAY_M, SWAY_S = (0.05, 0.1), (1.2, 2.5)
HELD_S, GOES_ON_S = (0.02, 0.3), (0.04, 0.6)
RETRY_NS = 1_000_000_000


class Reboot(Fault):
    """Watchdog restart of the autopilot: it neither receives nor sends, then its clock restarts at zero.

    Afterwards it is armed and in its mode, without guided target, landing target, ranges and message
    intervals.
    """

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.reboot(REBOOT_S)


class EstimateJump(Fault):
    """Reset of the position estimate by 5 m; the autopilot's own targets move with it."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._jump_enu_m = _level(rng, JUMP_M)

    def start(self, simulation: Simulation) -> None:
        simulation.estimator.jump_enu_m = simulation.estimator.jump_enu_m + self._jump_enu_m
        simulation.autopilot.follow_reset(self._jump_enu_m)


class BarometerJump(Fault):
    """Step of the barometer, by 3 m up or down by default, until the fault ends: the estimate slides to it.

    size_m: of the measured height, positive is up.
    """

    def __init__(self, rng: np.random.Generator, size_m: float | None = None) -> None:
        drawn_m = BAROMETER_M * (1 if rng.random() < 0.5 else -1)
        self._size_m = drawn_m if size_m is None else size_m

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.height.barometer_error_m = self._size_m

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.height.barometer_error_m = 0.0


class EstimateDrift(Fault):
    """Drift of the position estimate at 0.3 m/s, up to 5 m and permanent, while GPS is its source."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._velocity_enu_ms = _level(rng, DRIFT_MS)
        self._last_ns: int | None = None
        self._moved_m = 0.0

    def start(self, simulation: Simulation) -> None:
        self._last_ns = simulation.now_ns

    def on_tick(self, simulation: Simulation) -> None:
        if self._last_ns is None or self._moved_m >= DRIFT_M:
            return
        elapsed_s = min((simulation.now_ns - self._last_ns) * 1e-9, TICK_LIMIT_S)
        self._last_ns = simulation.now_ns
        if simulation.autopilot.aiding.sources.position is not Source.GPS:
            return
        self._moved_m += DRIFT_MS * elapsed_s
        estimator = simulation.estimator
        estimator.jump_enu_m = estimator.jump_enu_m + self._velocity_enu_ms * elapsed_s


class EstimateSway(Fault):
    """Sway of the estimated height by up to a decimetre about the truth, with a period of two seconds.

    A real PX4 (SIH, EKF2) sways so in hover and descent. Amplitude and period are drawn once.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._amplitude_m = float(rng.uniform(*SWAY_M))
        self._period_s = float(rng.uniform(*SWAY_S))
        self._start_ns = 0
        self._up_m = 0.0

    def start(self, simulation: Simulation) -> None:
        self._start_ns = simulation.now_ns

    def on_tick(self, simulation: Simulation) -> None:
        phase = 2 * math.pi * (simulation.now_ns - self._start_ns) * 1e-9 / self._period_s
        self._move(simulation, self._amplitude_m * math.sin(phase))

    def stop(self, simulation: Simulation) -> None:
        self._move(simulation, 0.0)

    def _move(self, simulation: Simulation, up_m: float) -> None:
        estimator = simulation.estimator
        estimator.jump_enu_m = estimator.jump_enu_m + np.array([0.0, 0.0, up_m - self._up_m])
        self._up_m = up_m


class ClockStall(Fault):
    """Repeated pauses of a simulated autopilot on a busy computer, so that its clock loses time.

    The autopilot and its vehicle pause for up to 0.3 s, a third of the time; sensors and the companion
    continue.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._until_ns = 0

    def start(self, simulation: Simulation) -> None:
        self._until_ns = simulation.now_ns

    def on_tick(self, simulation: Simulation) -> None:
        if simulation.now_ns >= self._until_ns:
            simulation.held_up = not simulation.held_up
            spans_s = HELD_S if simulation.held_up else GOES_ON_S
            self._until_ns = simulation.now_ns + round(float(self._rng.uniform(*spans_s)) * 1e9)

    def stop(self, simulation: Simulation) -> None:
        simulation.held_up = False


class PilotMode(Fault):
    """Takeover by the pilot: a mode that holds position or height, requested until it is active.

    Raises
    ------
    ValueError
        On `start`, if the simulation has no pilot.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._choice = int(rng.integers(len(Pilot.holding_modes)))
        self._next_ns = 0

    def start(self, simulation: Simulation) -> None:
        if simulation.pilot is None:
            raise ValueError("pilot mode: this simulation has no pilot; give it pilot_height_m")
        self._next_ns = simulation.now_ns
        self.on_tick(simulation)

    def on_tick(self, simulation: Simulation) -> None:
        pilot = simulation.pilot
        if pilot is None:
            return
        mode = pilot.holding_modes[self._choice]
        if pilot.mode != mode and simulation.now_ns >= self._next_ns:
            self._next_ns = simulation.now_ns + RETRY_NS
            pilot.set_mode(mode)


class WingFlight(Fault):
    """Transition of a vehicle that turns out to be a VTOL: straight on at 9.6 m/s, sinking, in any mode."""

    def start(self, simulation: Simulation) -> None:
        estimate = simulation.autopilot.estimate
        if estimate is not None:
            simulation.autopilot.airframe.fly_on(estimate, simulation.now_ns)

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.airframe.hover()


def _level(rng: np.random.Generator, length: float) -> F64:
    """Return a horizontal vector of a given length in a random direction."""
    bearing = float(rng.uniform(0.0, 2 * math.pi))
    return np.array([length * math.cos(bearing), length * math.sin(bearing), 0.0])
