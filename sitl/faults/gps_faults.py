"""GPS and compass faults: denial, multipath, slow drift, spoofing, a drifting heading.

They change what the receiver or the compass measures. The estimate follows as far as the filter does, see
`sitl.autopilot.position_aiding`, and not at all while it takes its position from external navigation.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

F64 = NDArray[np.float64]

TICK_LIMIT_S = 0.1
BOTH_NS = 2_000_000_000
WANDER_M, WANDER_S = (1.0, 3.0), (5.0, 20.0)
STEP_M, STEP_EVERY_S, STEP_TAU_S = (0.1, 0.4), 2.0, 4.0
DRIFT_MS = (0.1, 1.0)
ALIGNED_S, SPOOF_MS, SPOOF_MS2 = 3.0, (0.3, 1.0), 0.2
TAKEOVER_M = (15.0, 60.0)
YAW_DRIFT_DEG_S, YAW_DRIFT_DEG = (0.1, 1.0), 20.0


class GpsDenial(Fault):
    """Loss of the GPS fix for the rest of the flight, as by jamming near the ground."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._bearing_rad = _bearing(rng)

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.lose_gps(self._bearing_rad)


class FirstReceiverLoss(Fault):
    """Death of the first of two receivers; the second gives the position."""

    def __init__(self) -> None:
        self._dies_ns = 0

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.parameters["GPS2_TYPE"] = 1.0
        self._dies_ns = simulation.now_ns + BOTH_NS

    def on_tick(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.gnss.first_is_dead = simulation.now_ns >= self._dies_ns

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.gnss.first_is_dead = False


class _Evolving(Fault):
    """Fault that changes with time; `advance` is called with the time since the last tick."""

    def __init__(self) -> None:
        self._last_ns: int | None = None

    def start(self, simulation: Simulation) -> None:
        self._last_ns = simulation.now_ns

    def on_tick(self, simulation: Simulation) -> None:
        if self._last_ns is not None:
            elapsed_s = min((simulation.now_ns - self._last_ns) * 1e-9, TICK_LIMIT_S)
            self._last_ns = simulation.now_ns
            self.advance(simulation, elapsed_s)

    def advance(self, simulation: Simulation, elapsed_s: float) -> None:
        """Advance the fault."""


class GpsMultipath(_Evolving):
    """Reflected signals: the position wanders by 1 to 3 m within 5 to 20 s, with steps of decimetres.

    A step follows the one before it in direction and dies away within seconds. The Doppler velocity and the
    type of fix are as without the fault.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__()
        self._rng = rng
        self._most_m, self._tau_s = float(rng.uniform(*WANDER_M)), float(rng.uniform(*WANDER_S)) / 2
        self._wander, self._steps = np.zeros(2), np.zeros(2)
        self._bearing_rad = _bearing(rng)

    def advance(self, simulation: Simulation, elapsed_s: float) -> None:
        share = elapsed_s / self._tau_s
        draw = self._rng.standard_normal(2)
        self._wander += -share * self._wander + self._most_m / 2 * math.sqrt(2 * share) * draw
        self._steps *= math.exp(-elapsed_s / STEP_TAU_S)
        if self._rng.random() < elapsed_s / STEP_EVERY_S:
            self._bearing_rad += float(self._rng.normal(0.0, 0.5))
            self._steps += float(self._rng.uniform(*STEP_M)) * _level(self._bearing_rad)[:2]
        wrong = self._wander + self._steps
        wrong *= min(1.0, self._most_m / max(1e-9, float(np.hypot(*wrong))))
        simulation.autopilot.aiding.gnss.error_enu_m = np.array([*wrong, 0.0])

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.gnss.error_enu_m = np.zeros(3)


class GpsSlowDrift(_Evolving):
    """Drift of the measured position at a constant rate, without end; Doppler velocity agrees with it.

    rate_ms: 0.1 to 1 m/s by default. Where it ends, the position remains wrong.
    """

    def __init__(self, rng: np.random.Generator, rate_ms: float | None = None) -> None:
        super().__init__()
        rate = float(rng.uniform(*DRIFT_MS)) if rate_ms is None else rate_ms
        self._velocity_enu_ms = rate * _level(_bearing(rng))

    def advance(self, simulation: Simulation, elapsed_s: float) -> None:
        gnss = simulation.autopilot.aiding.gnss
        gnss.velocity_error_enu_ms = self._velocity_enu_ms
        gnss.error_enu_m = gnss.error_enu_m + elapsed_s * self._velocity_enu_ms

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.gnss.velocity_error_enu_ms = np.zeros(3)


class GpsSpoof(_Evolving):
    """Spoofed signals: three seconds in line with the true ones, then away at up to a speed.

    speed_ms: 0.3 to 1 m/s by default, reached at 0.2 m/s2. At the end the receiver is right again, and where
    it is far from the estimate the filter rejects it for ten seconds before it resets itself.
    """

    def __init__(self, rng: np.random.Generator, speed_ms: float | None = None) -> None:
        super().__init__()
        self._speed_ms = float(rng.uniform(*SPOOF_MS)) if speed_ms is None else speed_ms
        self._direction = _level(_bearing(rng))
        self._age_s = 0.0

    def advance(self, simulation: Simulation, elapsed_s: float) -> None:
        self._age_s += elapsed_s
        speed_ms = min(self._speed_ms, SPOOF_MS2 * max(0.0, self._age_s - ALIGNED_S))
        gnss = simulation.autopilot.aiding.gnss
        gnss.velocity_error_enu_ms = speed_ms * self._direction
        gnss.error_enu_m = gnss.error_enu_m + elapsed_s * gnss.velocity_error_enu_ms

    def stop(self, simulation: Simulation) -> None:
        gnss = simulation.autopilot.aiding.gnss
        gnss.error_enu_m, gnss.velocity_error_enu_ms = np.zeros(3), np.zeros(3)


class GpsTakeover(Fault):
    """Spoofed signals that are far away at once: rejected for ten seconds, then the filter jumps to them.

    distance_m: 15 to 60 m by default.
    """

    def __init__(self, rng: np.random.Generator, distance_m: float | None = None) -> None:
        distance = float(rng.uniform(*TAKEOVER_M)) if distance_m is None else distance_m
        self._error_enu_m = distance * _level(_bearing(rng))

    def start(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.gnss.error_enu_m = self._error_enu_m

    def stop(self, simulation: Simulation) -> None:
        simulation.autopilot.aiding.gnss.error_enu_m = np.zeros(3)


class YawDrift(_Evolving):
    """Drift of the compass's heading, up to 20 degrees and permanent, as by current or steel nearby.

    rate_deg_s: 0.1 to 1 degree per second by default, either way; positive is clockwise.
    """

    def __init__(self, rng: np.random.Generator, rate_deg_s: float | None = None) -> None:
        super().__init__()
        drawn = float(rng.uniform(*YAW_DRIFT_DEG_S)) * (1 if rng.random() < 0.5 else -1)
        self._rate_rad_s = math.radians(drawn if rate_deg_s is None else rate_deg_s)
        self._turned_rad = 0.0

    def advance(self, simulation: Simulation, elapsed_s: float) -> None:
        if abs(self._turned_rad) < math.radians(YAW_DRIFT_DEG):
            self._turned_rad += self._rate_rad_s * elapsed_s
            simulation.autopilot.aiding.compass_error_rad += self._rate_rad_s * elapsed_s


def _bearing(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.0, 2 * math.pi))


def _level(bearing_rad: float) -> F64:
    """Return the horizontal unit vector (3,) ENU of a bearing, clockwise from north."""
    return np.array([math.sin(bearing_rad), math.cos(bearing_rad), 0.0])
