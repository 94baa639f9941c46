"""Horizontal part of an inertial Kalman filter: position, velocity, and tilt, which one cannot know apart.

EKF3 and EKF2 predict by the accelerometer, turned level by the estimated tilt. A tilt error accelerates the
estimate away from the truth, and only measurements show it. The filter explains a velocity that is stated too
small, or one that is its own, by its tilt: it believes it, and the vehicle accelerates with a level estimate.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

GRAVITY_MS2 = 9.80665
ACCELERATION_NOISE_MS2, GYRO_NOISE_RAD_S = 0.35, 0.015
"""EK3_ACC_P_NSE, EK3_GYRO_P_NSE; EKF2_ACC_NOISE, EKF2_GYR_NOISE: white within a step of the filter."""
GPS_POSITION_M, GPS_VELOCITY_MS, GPS_INTERVAL_S = 0.5, 0.3, 0.2
"""EK3_POSNE_M_NSE, EK3_VELNE_M_NSE and the rate of a receiver, by which the filter settles."""
POSITION, VELOCITY, TILT = range(3)


@dataclass(frozen=True, slots=True)
class Step:
    """Prediction over a time: transition of position, velocity and acceleration error, and its noise."""

    transition: F64
    noise: F64


@functools.lru_cache(maxsize=64)
def _step(seconds: float, filter_step_s: float) -> Step:
    transition = np.array([[1.0, seconds, seconds**2 / 2], [0.0, 1.0, seconds], [0.0, 0.0, 1.0]])
    shaken = ACCELERATION_NOISE_MS2**2 * filter_step_s
    tilted = (GRAVITY_MS2 * GYRO_NOISE_RAD_S) ** 2 * filter_step_s
    noise = shaken * _integral(seconds, 1) + tilted * _integral(seconds, 2)
    return Step(transition, noise)


def _integral(seconds: float, order: int) -> F64:
    """Return the covariance (3, 3) of white noise of density 1 on velocity (1) or acceleration (2)."""
    powers = [order - row for row in range(3)]
    covariance = np.zeros((3, 3))
    for i, p in enumerate(powers):
        for j, q in enumerate(powers):
            if p >= 0 and q >= 0:
                scale = math.factorial(p) * math.factorial(q) * (p + q + 1)
                covariance[i, j] = seconds ** (p + q + 1) / scale
    return covariance


@functools.lru_cache(maxsize=4)
def _settled(filter_step_s: float) -> F64:
    """Return the covariance (3, 3) after a minute of GPS."""
    covariance = np.diag([GPS_POSITION_M**2, GPS_VELOCITY_MS**2, 0.5**2])
    for _ in range(300):
        covariance = _predicted(covariance, GPS_INTERVAL_S, filter_step_s)
        covariance = _updated(covariance, VELOCITY, GPS_VELOCITY_MS)[1]
        covariance = _updated(covariance, POSITION, GPS_POSITION_M)[1]
    covariance.flags.writeable = False
    return covariance


def _predicted(covariance: F64, seconds: float, filter_step_s: float) -> F64:
    step = _step(seconds, filter_step_s)
    return np.asarray(step.transition @ covariance @ step.transition.T + step.noise)


def _updated(covariance: F64, row: int, error: float) -> tuple[F64, F64]:
    """Return gain (3,) and covariance after a measurement of one state."""
    gain = covariance[:, row] / (covariance[row, row] + error**2)
    return gain, covariance - np.outer(gain, covariance[row])


class InertialFilter:
    """Covariance and gains, the same for east and north.

    Parameters
    ----------
    filter_step_s
        Step of the filter: its process noise is white within one.

    Attributes
    ----------
    covariance
        (3, 3): position (m2), velocity (m2/s2), and the acceleration (m2/s4) that the tilt's error makes.
    """

    def __init__(self, filter_step_s: float) -> None:
        self._filter_step_s = filter_step_s
        self.covariance = _settled(filter_step_s)

    def settle(self) -> None:
        """Take the covariance of a filter that has long had GPS."""
        self.covariance = _settled(self._filter_step_s)

    def predict(self, seconds: float) -> None:
        """Let the uncertainty grow over a time without measurements."""
        self.covariance = _predicted(self.covariance, seconds, self._filter_step_s)

    def test_ratio(self, row: int, apart: F64, error: float, gate: float) -> float:
        """Return a horizontal innovation as a share of the greatest that is accepted."""
        variance = 2.0 * (self.covariance[row, row] + error**2)
        return math.hypot(float(apart[0]), float(apart[1])) / (gate * math.sqrt(variance))

    def gain(self, row: int, error: float) -> F64:
        """Take a measurement of position or velocity; return the gain (3,) of its innovation."""
        gain, self.covariance = _updated(self.covariance, row, error)
        return gain

    def reset(self, row: int, error: float) -> None:
        """Take a state that was set to a measurement."""
        covariance = self.covariance.copy()
        covariance[row, :] = covariance[:, row] = 0.0
        covariance[row, row] = error**2
        self.covariance = covariance
