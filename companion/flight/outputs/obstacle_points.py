"""OBSTACLE_DISTANCE_3D: obstacles around the landing point and the vehicle as 3-D points.

ArduPilot accepts body forward-right-down only: another frame is dropped, although the sensor counts as alive.
Points with one stamp form one batch; a new stamp begins the next. Points outside the message's range are
dropped silently, and one point is kept in each of 8 directions by 5 elevations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.geometry.axes import Floats, PoseLike, body_frd_m

DIRECTIONS, LAYERS = 8, 5
LAYER_DEG = 30.0
UNNAMED = 65535


def obstacle_points(
    points_enu_m: ArrayLike, pose: PoseLike, stamp_ms: int, *, min_m: float, max_m: float
) -> list[Any]:
    """Return one batch of messages, nearest first: at most one for each face of ArduPilot's boundary.

    Parameters
    ----------
    points_enu_m
        Points of obstacles (n, 3) in the map frame, m.
    stamp_ms
        Stamp of the batch, different from the last batch's.
    min_m, max_m
        Range; points outside are ignored.
    """
    body = nearest_by_face(body_frd_m(np.reshape(points_enu_m, (-1, 3)), pose), min_m, max_m)
    return [
        mavlink.MAVLink_obstacle_distance_3d_message(
            stamp_ms % 2**32,
            mavlink.MAV_DISTANCE_SENSOR_LASER,
            mavlink.MAV_FRAME_BODY_FRD,
            UNNAMED,
            *point,
            min_m,
            max_m,
        )
        for point in body.tolist()
    ]


def nearest_by_face(points_frd_m: Floats, min_m: float, max_m: float) -> Floats:
    """Return the nearest point of each face (m, 3), nearest first, without NaN and points out of range."""
    distance = np.sqrt(np.einsum("ij,ij->i", points_frd_m, points_frd_m))
    kept = (distance > min_m) & (distance < max_m)  # excludes NaN; strict, as rounding may drop the edge
    points, distance = points_frd_m[kept], distance[kept]
    order = np.argsort(distance, kind="stable")
    _, first = np.unique(faces(points[order]), return_index=True)
    return np.asarray(points[order[np.sort(first)]])


def faces(points_frd_m: Floats) -> NDArray[np.intp]:
    """Return the number of the face that contains each point, 0 to 39."""
    forward, right, down = points_frd_m.T
    sector = np.rint(np.degrees(np.arctan2(right, forward)) / (360 / DIRECTIONS)).astype(np.intp) % DIRECTIONS
    pitch_deg = np.degrees(np.arctan2(-down, np.hypot(forward, right)))
    layer = np.clip(np.floor((pitch_deg + 2.5 * LAYER_DEG) / LAYER_DEG), 0, LAYERS - 1).astype(np.intp)
    return np.asarray(layer * DIRECTIONS + sector)
