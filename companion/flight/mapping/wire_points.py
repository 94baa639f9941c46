"""Wires near the vehicle as points, remembered longer than their returns."""

from __future__ import annotations

import numpy as np

from companion.flight.geometry.axes import Floats
from slz import Report

STEP_M = 0.5


def wire_points_enu_m(report: Report | None, position_enu_m: Floats, reach_m: float) -> Floats:
    """Return points (n, 3) along the wires of a report that are within a distance of a position.

    Extrapolated parts are included: a wire goes on beyond what was seen.
    """
    parts = [np.empty((0, 3))]
    for wire in () if report is None else report.wires:
        points, _, _ = wire.sampled(STEP_M)
        away_m = np.linalg.norm(points - position_enu_m, axis=1)
        parts.append(points[away_m <= reach_m])
    return np.concatenate(parts)
