"""Filter of the error of the autopilot's heading and position against an aligned odometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

YAW, SHIFT, RATE, TURN = 0, slice(1, 4), slice(4, 7), 7
# Errors of an autopilot's estimate, as in the filter of the LiDAR odometry: heading and position wander, and
# without GPS the position drifts ever faster.
YAW_RAD_SQRT_S, AWAY_M_SQRT_S, UP_M_SQRT_S = np.radians(0.1), 0.02, 0.03
RATE_MS, RATE_S = 0.1, 5.0
TURN_RAD_SQRT_S = np.radians(0.02)  # by which the heading of an odometry wanders
# Noise from pose to pose: not the odometry's own uncertainty, which successive poses share.
NOISE_RAD, NOISE_M = np.radians(0.5), 0.05


class ShiftFilter:
    """Gaussian filter of the autopilot's errors, and of that of the alignment.

    The alignment's rotation about up is known to degrees at first, by which a long way would lead off: an
    error across the way in proportion to it is that of the alignment, any other one the autopilot's.

    Parameters
    ----------
    yaw_rad, shift_m
        Error that is corrected already.
    sigma_rad
        Standard deviation of the alignment's rotation about up.

    Attributes
    ----------
    state
        (8,): heading (rad), shift east, north, up (m), its rate (m/s), rotation of the alignment (rad).
    covariance
        (8, 8).
    """

    def __init__(self, yaw_rad: float, shift_m: Floats, sigma_rad: float) -> None:
        self.state = np.array([yaw_rad, *shift_m, *np.zeros(4)])
        self.covariance = np.zeros((8, 8))
        self.covariance[RATE, RATE] = np.eye(3) * RATE_MS**2
        self.covariance[TURN, TURN] = sigma_rad**2

    def predict(self, seconds: float) -> None:
        """Let time pass."""
        move = np.eye(8)
        move[SHIFT, RATE] = np.eye(3) * seconds
        move[RATE, RATE] *= np.exp(-seconds / RATE_S)
        rate = RATE_MS**2 * (1 - move[4, 4] ** 2)
        grown = np.array([YAW_RAD_SQRT_S, AWAY_M_SQRT_S, AWAY_M_SQRT_S, UP_M_SQRT_S]) ** 2 * seconds
        noise = np.diag([*grown, rate, rate, rate, TURN_RAD_SQRT_S**2 * seconds])
        self.state = move @ self.state
        self.covariance = move @ self.covariance @ move.T + noise

    def update(self, measured: Floats, way_m: Floats, learns: bool) -> float:
        """Take a measurement; return the error (rad) by which the alignment must be turned back about up.

        Parameters
        ----------
        measured
            (4,) heading error, rad, less than half a turn from the state's, and shift, m.
        way_m
            (3,) from where the alignment holds exactly to the vehicle.
        learns
            Whether the autopilot's way is sure enough to give the error of the alignment.
        """
        model = np.eye(4, 8)
        if learns:
            model[1:3, TURN] = -way_m[1], way_m[0]
        noise = np.diag([NOISE_RAD**2] + [NOISE_M**2] * 3)
        gain = np.linalg.solve(model @ self.covariance @ model.T + noise, model @ self.covariance).T
        gain[TURN] *= learns
        self.state = self.state + gain @ (measured - self.state[:4])
        rest = np.eye(8) - gain @ model
        self.covariance = rest @ self.covariance @ rest.T + gain @ noise @ gain.T
        turn, self.state[TURN] = float(self.state[TURN]), 0.0
        return turn
