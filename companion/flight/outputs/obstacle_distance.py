"""OBSTACLE_DISTANCE: the nearest obstacle in each of 72 directions around the vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.outputs.sectors import mark_columns, mark_returns

SECTORS = 72
SECTOR_DEG = 360.0 / SECTORS
UNKNOWN = 65535
LARGEST_CM = 65533


def obstacle_distance(
    points_frd_m: ArrayLike,
    now_ns: int,
    *,
    min_m: float,
    max_m: float,
    band_m: tuple[float, float] = (-2.0, 2.0),
    columns_frd_m: ArrayLike = (),
    cell_m: float = 0.0,
) -> Any:
    """Return the message for returns and map cells around the vehicle.

    A sector holds the horizontal distance of its nearest return or cell within the height band; else "free"
    (one more than the maximum) if a ray stayed in the band out to the maximum; else "unknown".

    Parameters
    ----------
    points_frd_m
        Returns (n, 3) in level forward-right-down (`geometry.axes.level_frd_m`), m; rows with NaN are
        ignored.
    now_ns
        Companion clock.
    min_m, max_m
        Range: nearer returns are the vehicle itself, farther ones are not obstacles yet.
    band_m
        Height band, down positive, in which a return is an obstacle; it must include the vehicle's height, 0.
    columns_frd_m, cell_m
        Map cells (m, 3) in the same axes: forward and right of their centres, down of their tops; and their
        side. A cell is solid from the ground to its top.

    Raises
    ------
    ValueError
        The band does not include the vehicle's height.
    """
    distances_cm = sector_distances_cm(
        points_frd_m, min_m=min_m, max_m=max_m, band_m=band_m, columns_frd_m=columns_frd_m, cell_m=cell_m
    )
    return mavlink.MAVLink_obstacle_distance_message(
        max(1, now_ns // 1000),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        [int(value) for value in distances_cm],
        round(SECTOR_DEG),
        _cm(min_m),
        _cm(max_m),
        SECTOR_DEG,
        0.0,
        mavlink.MAV_FRAME_BODY_FRD,
    )


def sector_distances_cm(
    points_frd_m: ArrayLike,
    *,
    min_m: float,
    max_m: float,
    band_m: tuple[float, float],
    columns_frd_m: ArrayLike = (),
    cell_m: float = 0.0,
) -> NDArray[np.uint16]:
    """Return (72,) distances in centimetres; sector i is centred i x 5 degrees clockwise from forward."""
    low, high = band_m
    if not low < 0 < high:
        raise ValueError(f"height band {band_m} m does not hold the vehicle's own height")
    nearest, seen_free = np.full(SECTORS, np.inf), np.zeros(SECTORS, dtype=np.bool_)
    mark_returns(_rows(points_frd_m), min_m, max_m, low, high, nearest, seen_free)
    mark_columns(_rows(columns_frd_m), cell_m / 2, min_m, max_m, high, nearest)

    cm = np.where(seen_free, _cm(max_m) + 1, UNKNOWN)
    found = np.isfinite(nearest)
    # Rounded down, but not below the minimum, where it would mean no obstacle.
    cm[found] = np.clip(np.floor(nearest[found] * 100), _cm(min_m), _cm(max_m))
    return cm.astype(np.uint16)


def _rows(points: ArrayLike) -> NDArray[np.float64]:
    return np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)


def _cm(metres: float) -> int:
    return min(round(metres * 100), LARGEST_CM)
