"""Ways in and out of the landing point, and the wind, as entities of Foxglove's scene."""

from __future__ import annotations

import math

import numpy as np
from foxglove.messages import (
    ArrowPrimitive,
    Color,
    Duration,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    TextPrimitive,
    Timestamp,
    Vector3,
)
from numpy.typing import NDArray

from companion.flight.geometry.wind import Wind
from slz import SAFE, UNKNOWN, Corridors
from slz.landing_point.corridors import STEP_DEG

LINE_M = 10.0  # length of a way's line
UPWIND_M, ARROW_M, OVER_M = (
    14.0,
    4.0,
    2.0,
)  # the wind's arrow beside the point, its length, and its height over it
CLEAR, BLOCKED = Color(r=0.24, g=0.86, b=0.52, a=0.9), Color(r=0.9, g=0.2, b=0.15, a=0.9)
UNSEEN, WIND = Color(r=0.7, g=0.72, b=0.75, a=0.5), Color(r=1.0, g=0.88, b=0.3, a=1.0)
Floats = NDArray[np.float64]


def ways(corridors: Corridors, stamp: Timestamp, frame_id: str, lifetime: Duration) -> SceneEntity:
    """Return a line a bearing: clear at its least slope, blocked to the obstacle, unseen level."""
    points, colours = [], []
    for k, states in enumerate(corridors.states[:, :-1]):  # all but straight up
        angle, colour = math.radians(k * STEP_DEG), BLOCKED
        end = corridors.obstacles_enu_m[k]
        if (states == SAFE).any():
            rise = math.radians(corridors.clear_slope_deg[k])
            end, colour = (
                corridors.enu_m + _ahead(angle, LINE_M * math.cos(rise), LINE_M * math.sin(rise)),
                CLEAR,
            )
        elif (states == UNKNOWN).any():
            end, colour = corridors.enu_m + _ahead(angle, LINE_M, 0.0), UNSEEN
        points += [_point(corridors.enu_m), _point(end)]
        colours += [colour, colour]
    lines = LinePrimitive(
        type=LinePrimitiveLineType.LineList,
        points=points,
        colors=colours,
        thickness=2.0,
        scale_invariant=True,
    )
    return SceneEntity(
        timestamp=stamp, frame_id=frame_id, id="ways in and out", lifetime=lifetime, lines=[lines]
    )


def wind_arrow(wind: Wind, enu_m: Floats, stamp: Timestamp, frame_id: str, lifetime: Duration) -> SceneEntity:
    """Return an arrow beside a point (3,), upwind of it, towards where the wind blows, with its speed."""
    tail = enu_m + _ahead(wind.from_rad, UPWIND_M, OVER_M)
    half = (math.pi / 2 - wind.from_rad - math.pi) / 2  # identity points east, turns are anticlockwise
    turned = Quaternion(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
    arrow = ArrowPrimitive(
        pose=Pose(position=_vector(tail), orientation=turned),
        shaft_length=0.7 * ARROW_M,
        shaft_diameter=0.3,
        head_length=0.3 * ARROW_M,
        head_diameter=0.9,
        color=WIND,
    )
    text = TextPrimitive(
        pose=Pose(
            position=_vector(tail + np.array([0.0, 0.0, 1.0])),
            orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
        ),
        billboard=True,
        font_size=14.0,
        scale_invariant=True,
        color=WIND,
        text=f"wind {wind.speed_ms:.1f} m/s",
    )
    return SceneEntity(
        timestamp=stamp, frame_id=frame_id, id="wind", lifetime=lifetime, arrows=[arrow], texts=[text]
    )


def _ahead(bearing_rad: float, level_m: float, rise_m: float) -> Floats:
    return np.array([level_m * math.sin(bearing_rad), level_m * math.cos(bearing_rad), rise_m])


def _point(enu_m: Floats) -> Point3:
    east, north, up = np.nan_to_num(enu_m).tolist()
    return Point3(x=east, y=north, z=up)


def _vector(enu_m: Floats) -> Vector3:
    east, north, up = np.nan_to_num(enu_m).tolist()
    return Vector3(x=east, y=north, z=up)
