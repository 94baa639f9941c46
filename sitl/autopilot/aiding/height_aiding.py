"""Error of the estimated height by its barometer: a step of what that measures is followed within seconds.

A step of some metres is within the filter's gate (EK3_HGT_I_GATE, EKF2_BARO_GATE) and is fused without a
word. The height slides to it, and so does a part of the vertical velocity, which GPS holds back. The
autopilot's height controller keeps its own target, and flies the slide back.
"""

from __future__ import annotations

HEIGHT_GAIN_PER_S, VELOCITY_GAIN_PER_S2 = 1.0, 0.5
"""Gains of the filter: the height is 72 % of a step away after one second, 98 % after two."""
HELD_PER_S = 1.4  # by the vertical velocity of GPS
CONVERGED_M, CONVERGED_MS = 1e-3, 1e-3


class HeightAiding:
    """Height of the estimate over the true one, in the wake of its barometer.

    Attributes
    ----------
    barometer_error_m
        Error of the measured height beyond that of `EstimateErrors`, set by faults.
    offset_up_m, velocity_error_up_ms
        Added to the estimate.
    """

    def __init__(self) -> None:
        self.barometer_error_m = 0.0
        self.offset_up_m = self.velocity_error_up_ms = 0.0

    def update(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        apart_m = self.barometer_error_m - self.offset_up_m
        if apart_m == self.velocity_error_up_ms == 0.0:
            return  # the case of every tick without a fault
        velocity_ms = self.velocity_error_up_ms
        self.offset_up_m += (velocity_ms + HEIGHT_GAIN_PER_S * apart_m) * dt_s
        self.velocity_error_up_ms += (VELOCITY_GAIN_PER_S2 * apart_m - HELD_PER_S * velocity_ms) * dt_s
        if abs(apart_m) < CONVERGED_M and abs(velocity_ms) < CONVERGED_MS:
            self.offset_up_m, self.velocity_error_up_ms = self.barometer_error_m, 0.0
