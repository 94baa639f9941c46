"""Moving objects as entities of Foxglove's scene: a cylinder each, and an arrow to where it will be."""

from __future__ import annotations

import math

from foxglove.messages import (
    ArrowPrimitive,
    Color,
    CylinderPrimitive,
    Duration,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    Timestamp,
    Vector3,
)

from slz import MovingObject

AHEAD_S = 2.0
SHOWN_S = 0.5  # after the last message about it
COLOUR = Color(r=1.0, g=0.55, b=0.1, a=0.8)


def moving(objects: tuple[MovingObject, ...], at_ns: int, stamp: Timestamp, frame_id: str) -> SceneUpdate:
    """Return objects where they are at a time (ns) of the companion's clock."""
    return SceneUpdate(entities=[_entity(one, at_ns, stamp, frame_id) for one in objects])


def _entity(one: MovingObject, at_ns: int, stamp: Timestamp, frame_id: str) -> SceneEntity:
    east, north = (float(v) for v in one.at(at_ns))
    up = 0.0 if math.isnan(one.ground_m) else one.ground_m
    speed_ms, bearing = math.hypot(*one.velocity_ms), math.atan2(one.velocity_ms[1], one.velocity_ms[0])
    body = CylinderPrimitive(
        pose=_pose(east, north, up + one.height_m / 2),
        size=Vector3(x=2 * one.radius_m, y=2 * one.radius_m, z=one.height_m),
        bottom_scale=1.0,
        top_scale=1.0,
        color=COLOUR,
    )
    arrow = ArrowPrimitive(
        pose=_pose(east, north, up + one.height_m, bearing),
        shaft_length=AHEAD_S * speed_ms,
        shaft_diameter=0.1,
        head_length=0.4,
        head_diameter=0.3,
        color=COLOUR,
    )
    lifetime = Duration(sec=0, nsec=round(SHOWN_S * 1e9))
    return SceneEntity(
        timestamp=stamp,
        frame_id=frame_id,
        id=f"moving {one.number}",
        lifetime=lifetime,
        cylinders=[body],
        arrows=[arrow],
    )


def _pose(east: float, north: float, up: float, turn: float = 0.0) -> Pose:
    return Pose(
        position=Vector3(x=east, y=north, z=up),
        orientation=Quaternion(x=0.0, y=0.0, z=math.sin(turn / 2), w=math.cos(turn / 2)),
    )
