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
    """Return the message for returns and cells of the map around the vehicle.

    A sector holds the horizontal distance of its nearest return or cell within the height band; else "free"
    (one more than the maximum) if a return shows that a ray stayed in the band out to the maximum; else
    "unknown".

    Parameters
    ----------
    points_frd_m
        Returns (n, 3) forward, right, down of the vehicle, level (`outputs.axes.level_frd_m`), m; rows with
        NaN are left out.
    now_ns
        Companion clock.
    min_m, max_m
        Nearer returns are the vehicle itself; farther ones are no obstacle yet.
    band_m
        Heights, down positive, between which a return is in the way; the vehicle's own, 0, lies inside.
    columns_frd_m, cell_m
        Cells of the map (m, 3): forward and right of their centres, down of their tops, in the same axes;
        and their side. A cell is solid from the ground to its top.

    Raises
    ------
    ValueError
        If the band does not hold the vehicle's height.
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
    # Rounded towards the vehicle, but never below the minimum, where it would read as nothing there.
    cm[found] = np.clip(np.floor(nearest[found] * 100), _cm(min_m), _cm(max_m))
    return cm.astype(np.uint16)


def _rows(points: ArrayLike) -> NDArray[np.float64]:
    return np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)


def _cm(metres: float) -> int:
    return min(round(metres * 100), LARGEST_CM)
