"""Height above ground, and obstacles around the vehicle and the landing point."""

from __future__ import annotations

import math

import numpy as np

from companion.flight.geometry.axes import Floats
from companion.flight.mapping.recent_obstacles import RecentObstacles
from slz import Nearby, SelectedPoint

BAND_M = 2.0
LEAST_BAND_M = 0.3


def height_m(
    position_enu_m: Floats, now_ns: int, memory: RecentObstacles, around: Nearby | None, relief_m: float
) -> float:
    """Return the height over the map, or over fresh returns where the map is unknown; NaN without either.

    Where they differ by more than the relief limit, the lesser height is returned.
    """
    up = float(position_enu_m[2])
    mapped = math.nan if around is None else up - around.ground_below_m(position_enu_m)
    fresh = up - memory.ground_below_m(position_enu_m, now_ns)
    if math.isnan(mapped):
        return fresh
    return min(mapped, fresh) if abs(mapped - fresh) > relief_m else mapped


def band_m(height_over_ground_m: float, relief_m: float) -> tuple[float, float]:
    """Return the height band (down positive) in which a return is an obstacle: 2 m up and down, no ground."""
    if math.isnan(height_over_ground_m):
        return -BAND_M, BAND_M
    return -BAND_M, min(BAND_M, max(LEAST_BAND_M, height_over_ground_m - relief_m))


def obstacle_points_enu_m(
    position_enu_m: Floats, around: Nearby | None, selected: SelectedPoint | None, low_m: float
) -> Floats:
    """Return the point nearest to the vehicle of each obstacle column, (n, 3) in the map frame, m.

    Parameters
    ----------
    around
        Map around the vehicle; its cells count from `low_m` below the vehicle upwards.
    selected
        Selected point; its obstacles count at any height, and so does what blocks its ways in and out.
    """
    columns = [] if around is None else [around.columns_enu_m(float(position_enu_m[2]) - low_m)]
    if selected is not None and selected.surroundings is not None:
        for obstacle in selected.surroundings.obstacles:
            top = np.full((len(obstacle.cells_enu_m), 1), obstacle.top_m)
            columns.append(np.hstack([obstacle.cells_enu_m, top]))
    if selected is not None and selected.corridors is not None:
        columns.append(selected.corridors.blocking_enu_m)
    if not columns:
        return np.empty((0, 3))
    points = np.concatenate(columns)
    points[:, 2] = np.minimum(points[:, 2], position_enu_m[2])
    return points
