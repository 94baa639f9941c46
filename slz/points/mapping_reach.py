"""Horizontal distance from the sensor up to which returns are mapped."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.frame import is_known
from slz.kernels.points.range_gate import within_reach

Points = NDArray[np.float64]


def reach_m(parameters: Parameters) -> float:
    """Return the horizontal distance from the sensor up to which returns are mapped (m).

    An error of a ray's direction moves its return up or down by that angle times the horizontal distance.
    Beyond the distance where this exceeds `height_noise_m`, noise alone would use up the relief limit; such
    ground stays unknown until the vehicle is nearer. The sources have no such rule.
    """
    p = parameters
    if p.mode == "source" or p.angle_noise_deg == 0:
        return p.max_range_m
    allowed = max(0.0, p.height_noise_m**2 - p.range_noise_m**2) ** 0.5
    return float(min(p.max_range_m, allowed / math.radians(p.angle_noise_deg)))


def within(points_enu_m: Points, sensor_enu_m: Points, reach_m: float) -> NDArray[np.bool_]:
    """Tell which points are no farther from the sensor over ground; all where its place is unknown."""
    if not is_known(sensor_enu_m[:2]):
        return np.ones(len(points_enu_m), bool)
    return within_reach(points_enu_m, sensor_enu_m, reach_m**2)
