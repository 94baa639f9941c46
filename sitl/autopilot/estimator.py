"""Simulated state estimator: the truth with errors like those of an EKF on GPS, compass and barometer."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.aiding.inertial_filter import GRAVITY_MS2
from sitl.autopilot.position_aiding import PositionAiding
from sitl.compilation import kernel_for_any_types
from sitl.vehicle.rigid_body import State, from_euler, multiply, ned, rotate

F64 = NDArray[np.float64]
SMOOTHING_S = 2.0
DRIFT_HOLD_S = 10.0
SEVERITIES: dict[str, tuple[float, float]] = {
    "none": (0.0, 0.0),
    "light": (0.00375, 0.00125),
    "moderate": (0.0075, 0.0025),
    "strong": (0.015, 0.005),
    "severe": (0.03, 0.01),
}
"""Standard deviation of the drift's velocity, horizontal and vertical, m/s: the intensities of dynablox."""


@dataclass(frozen=True, slots=True)
class EstimateErrors:
    """Error model: standard deviations and correlation times of slow errors, plus white noise.

    The defaults represent a GPS receiver with a clear sky after the filter has settled; drift over a minute
    is some decimetres, attitude a tenth of a degree.

    ``drift_ms`` and ``drift_up_ms`` are standard deviations of a velocity error that is drawn anew every
    ``DRIFT_HOLD_S`` along the body's axes and integrated: a random walk of the position without an end.
    """

    horizontal_m: float = 0.15
    vertical_m: float = 0.15
    position_tau_s: float = 60.0
    velocity_ms: float = 0.03
    velocity_tau_s: float = 5.0
    tilt_deg: float = 0.1
    tilt_tau_s: float = 20.0
    yaw_deg: float = 0.5
    yaw_tau_s: float = 60.0
    white_position_m: float = 0.003
    white_velocity_ms: float = 0.01
    white_attitude_deg: float = 0.02
    drift_ms: float = 0.0
    drift_up_ms: float = 0.0

    @classmethod
    def none(cls) -> EstimateErrors:
        """Return the model of an error-free estimate."""
        return cls(**dict.fromkeys(("horizontal_m", "vertical_m", "velocity_ms", "tilt_deg", "yaw_deg"), 0.0),
                   white_position_m=0.0, white_velocity_ms=0.0, white_attitude_deg=0.0)  # fmt: skip

    @classmethod
    def of_severity(cls, name: str) -> EstimateErrors:
        """Return the default model with a drift of one of `SEVERITIES`.

        After a minute the drift of "severe" is 0.73 m per horizontal axis, of "light" 0.09 m (one sigma).
        The numbers and the process are those of dynablox (Schmid et al., RA-L 2023; drift_simulation of
        github.com/ethz-asl/dynablox): velocity noise at 0.1 Hz, no drift of the heading, no white noise.

        Raises
        ------
        ValueError
            There is no severity of that name.
        """
        if name not in SEVERITIES:
            raise ValueError(f"drift {name!r}: there are {', '.join(SEVERITIES)}")
        level, up = SEVERITIES[name]
        return replace(cls(), drift_ms=level, drift_up_ms=up)


class VelocityDrift:
    """Random walk of the position by a velocity error that is held for `DRIFT_HOLD_S`."""

    def __init__(self, rng: np.random.Generator, errors: EstimateErrors) -> None:
        self._rng = rng
        self._sigma_ms = np.array([errors.drift_ms, errors.drift_ms, errors.drift_up_ms])
        self._left_s = 0.0
        self.position_enu_m: F64 = np.zeros(3)
        self.velocity_enu_ms: F64 = np.zeros(3)
        self.is_off = not self._sigma_ms.any()

    def update(self, dt_s: float, state: State) -> None:
        """Advance by `dt_s` at a true state."""
        if self._left_s <= 0.0:
            self._left_s += DRIFT_HOLD_S
            drawn = self._sigma_ms * self._rng.standard_normal(3)
            self.velocity_enu_ms = ned(rotate(state.quat_wxyz, drawn))
        self._left_s -= dt_s
        self.position_enu_m = self.position_enu_m + self.velocity_enu_ms * dt_s


@kernel_for_any_types
def _drift(error: F64, smooth: F64, sigma: F64, tau: F64, dt: float, draw: F64) -> None:
    """Advance Gauss-Markov errors and their low-passed values, which are the ones used."""
    for i in range(len(error)):
        share = dt / tau[i]
        error[i] += -error[i] * share + sigma[i] * np.sqrt(2 * share) * draw[i]
        smooth[i] += (error[i] - smooth[i]) * dt / SMOOTHING_S


class Estimator:
    """Estimator that converts true states to estimated ones, tick by tick.

    `aiding` is shared with the autopilot, which reports it; by default GPS is never lost.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        errors: EstimateErrors | None = None,
        aiding: PositionAiding | None = None,
    ) -> None:
        e = errors or EstimateErrors()
        self._rng = rng
        self._aiding = aiding or PositionAiding()
        tilt, yaw = np.radians(e.tilt_deg), np.radians(e.yaw_deg)
        self._sigma = np.array(
            [e.horizontal_m] * 2 + [e.vertical_m] + [e.velocity_ms] * 3 + [tilt] * 2 + [yaw]
        )
        self._tau = np.array(
            [e.position_tau_s] * 3 + [e.velocity_tau_s] * 3 + [e.tilt_tau_s] * 2 + [e.yaw_tau_s]
        )
        self._white = np.array(
            [e.white_position_m] * 3 + [e.white_velocity_ms] * 3 + [np.radians(e.white_attitude_deg)] * 3
        )
        self._error = self._sigma * rng.standard_normal(9)
        self._smooth = self._error.copy()
        self._drift = VelocityDrift(rng.spawn(1)[0], e)
        self._draws = np.zeros((0, 18))
        self._next = 0
        self.jump_enu_m = np.zeros(3)
        """Offset added to every position: a reset of the filter."""

    def update(self, dt_s: float, state: State) -> State:
        """Return the estimate of a true state, `dt_s` after the last."""
        if self._next == len(self._draws):
            self._draws, self._next = self._rng.standard_normal((2048, 18)), 0
        draw = self._draws[self._next]
        self._next += 1
        _drift(self._error, self._smooth, self._sigma, self._tau, dt_s, draw[:9])
        off = self._smooth + self._white * draw[9:]
        aiding = self._aiding
        aiding.update(dt_s)
        aiding.height.update(dt_s)
        turn = np.array([1.0, off[6] / 2, off[7] / 2, off[8] / 2])
        turn /= np.sqrt(float(turn @ turn))
        fall = aiding.acceleration_error_enu_ms2
        if (
            fall[0] or fall[1]
        ):  # leaning over to its east, the estimate takes a part of the thrust for one eastwards
            half = fall / (2 * GRAVITY_MS2)
            turn = multiply(np.array([1.0, half[0], -half[1], 0.0]), turn)
        if aiding.heading_error_rad:
            turn = multiply(from_euler(0.0, 0.0, aiding.heading_error_rad), turn)
        position = state.pos_enu_m + off[0:3] + self.jump_enu_m + aiding.offset_enu_m
        velocity = state.vel_enu_ms + off[3:6] + aiding.velocity_error_enu_ms
        position[2] += aiding.height.offset_up_m
        velocity[2] += aiding.height.velocity_error_up_ms
        if not self._drift.is_off:
            self._drift.update(dt_s, state)
            position, velocity = position + self._drift.position_enu_m, velocity + self._drift.velocity_enu_ms
        return State(
            pos_enu_m=position,
            vel_enu_ms=velocity,
            quat_wxyz=multiply(turn, state.quat_wxyz),
            rates_frd_rad_s=state.rates_frd_rad_s,
            acc_enu_ms2=state.acc_enu_ms2,
        )
