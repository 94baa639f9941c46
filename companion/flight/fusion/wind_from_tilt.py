"""Wind from the tilt of a multirotor: the horizontal part of its thrust balances its drag."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.axes import rotation_enu_from_frd

Floats = NDArray[np.float64]

GRAVITY_MS2 = 9.80665
SPAN_NS = 3_000_000_000  # of a mean: WMO's averaging time of gusts
STEP_NS = 90_000_000
GAP_NS = 500_000_000
MOST_ACCELERATION_MS2 = 1.0  # mean over the span; beyond, errors of time between tilt and velocity dominate
MOST_MS = 8.0  # mean ground speed; beyond, the quadratic drag of the body, which is left out, becomes large
LEAST_UPRIGHT = 0.7  # cosine of the tilt


class TiltWind:
    """Means of the wind over 3 s from attitudes and velocities.

    With a drag of `drag_per_s` (1/s) per unit of airspeed and mass, linear as that of rotors (PX4's
    EKF2_MCOEF, ArduPilot's EK3_DRAG_MCOEF), and the unit thrust vector t, the force balance is

        a = T t - g - drag_per_s (v - w),    T = (g + a_z + drag_per_s v_z) / t_z,    w_z = 0

    and its horizontal part is solved for the wind w. The mean acceleration over the span is the change of
    velocity, so nothing is differentiated. An error e of the tilt (rad) is an error of g e / drag_per_s of
    the wind: at 0.2 1/s, 0.9 m/s per degree. A relative error of the drag is one of the airspeed.
    """

    def __init__(self, drag_per_s: float) -> None:
        self._drag_per_s = drag_per_s
        self._samples: deque[tuple[int, Floats, Floats]] = deque()

    def clear(self) -> None:
        """Discard the samples, after a gap or a reset of the estimate."""
        self._samples.clear()

    def add(self, stamp_ns: int, quat_wxyz: Sequence[float], velocity_enu_ms: Floats) -> Floats | None:
        """Add a sample in flight; return the mean wind (2,) towards east, north of the last 3 s.

        None too early, between steps of 0.1 s, and while the vehicle accelerates hard or flies fast.
        """
        if self._samples:
            elapsed_ns = stamp_ns - self._samples[-1][0]
            if not 0 <= elapsed_ns <= GAP_NS:
                self._samples.clear()
            elif elapsed_ns < STEP_NS:
                return None
        thrust = -rotation_enu_from_frd(quat_wxyz)[:, 2]
        if thrust[2] < LEAST_UPRIGHT:
            self._samples.clear()
            return None
        self._samples.append((stamp_ns, np.asarray(velocity_enu_ms, np.float64), thrust[:2] / thrust[2]))
        while stamp_ns - self._samples[0][0] > SPAN_NS:
            self._samples.popleft()
        span_ns = stamp_ns - self._samples[0][0]
        return self._mean(span_ns * 1e-9) if span_ns > SPAN_NS - 2 * STEP_NS else None

    def _mean(self, span_s: float) -> Floats | None:
        velocity = np.array([sample[1] for sample in self._samples])
        slope = np.array([sample[2] for sample in self._samples])
        acceleration = (velocity[-1] - velocity[0]) / span_s
        mean = velocity.mean(axis=0)
        hard = float(np.hypot(*acceleration[:2])) > MOST_ACCELERATION_MS2
        if hard or float(np.hypot(*mean[:2])) > MOST_MS:
            return None
        up = GRAVITY_MS2 + acceleration[2] + self._drag_per_s * velocity[:, 2:]
        lift = (up * slope).mean(axis=0)
        airspeed = (lift - acceleration[:2]) / self._drag_per_s
        return np.asarray(mean[:2] - airspeed)
