"""How high the vehicle is above what lies below it, and what around it is in its way."""

from __future__ import annotations

import math

import numpy as np

from companion.flight.geometry.axes import Floats
from companion.flight.mapping.recent_obstacles import ObstacleMemory
from slz import Nearby, SelectedPoint

BAND_M = 2.0
LEAST_BAND_M = 0.3


def height_m(
    position_enu_m: Floats, now_ns: int, memory: ObstacleMemory, around: Nearby | None, relief_m: float
) -> float:
    """Return the height over the map, or over fresh returns where it is unknown; NaN where neither is known.

    Where they differ by more than the relief limit, the nearer one counts.
    """
    up = float(position_enu_m[2])
    mapped = math.nan if around is None else up - around.ground_below_m(position_enu_m)
    fresh = up - memory.ground_below_m(position_enu_m, now_ns)
    if math.isnan(mapped):
        return fresh
    return min(mapped, fresh) if abs(mapped - fresh) > relief_m else mapped


def band_m(height_over_ground_m: float, relief_m: float) -> tuple[float, float]:
    """Return the heights, down positive, that are in the way: 2 m up and down, but not the ground."""
    if math.isnan(height_over_ground_m):
        return -BAND_M, BAND_M
    return -BAND_M, min(BAND_M, max(LEAST_BAND_M, height_over_ground_m - relief_m))


def obstacle_points_enu_m(
    position_enu_m: Floats, around: Nearby | None, selected: SelectedPoint | None, low_m: float
) -> Floats:
    """Return (n, 3) the points nearest to the vehicle of all that stands around it and the selected point.

    Parameters
    ----------
    around
        Its cells that reach higher than `low_m` below the vehicle.
    selected
        Its obstacles count at whatever height.
    """
    columns = [] if around is None else [around.columns_enu_m(float(position_enu_m[2]) - low_m)]
    if selected is not None and selected.surroundings is not None:
        for obstacle in selected.surroundings.obstacles:
            top = np.full((len(obstacle.cells_enu_m), 1), obstacle.top_m)
            columns.append(np.hstack([obstacle.cells_enu_m, top]))
    if not columns:
        return np.empty((0, 3))
    points = np.concatenate(columns)
    points[:, 2] = np.minimum(points[:, 2], position_enu_m[2])
    return points
