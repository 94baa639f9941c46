"""Converters of a flight's data to Foxglove's message schemas, for Foxglove and Lichtblick."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from typing import Any

import foxglove
import numpy as np
from foxglove import Channel, Schema
from foxglove.channels import (
    FrameTransformChannel,
    GeoJsonChannel,
    LocationFixChannel,
    LogChannel,
    PointCloudChannel,
    SceneUpdateChannel,
)
from foxglove.messages import (
    Color,
    Duration,
    FrameTransform,
    GeoJson,
    LinePrimitive,
    LinePrimitiveLineType,
    LocationFix,
    Log,
    LogLevel,
    PackedElementField,
    PackedElementFieldNumericType,
    Point3,
    PointCloud,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    TextPrimitive,
    Timestamp,
    Vector3,
)
from numpy.typing import NDArray

from companion.flight.geometry.pose import Pose as VehiclePose
from companion.flight.geometry.wind import Wind
from companion.flight.outputs.geojson_features import wire_feature, zone_feature
from companion.flight.recorder import foxglove_moving, journal
from companion.flight.recorder.foxglove_ways import ways, wind_arrow
from companion.flight.recorder.topics import (
    FIX,
    GEOJSON,
    LOG,
    MOST_POINTS,
    MOVING,
    PARAMETERS,
    POINTS,
    TRANSFORM,
    ZONES,
)
from slz import LocalFrame, MovingObject, PointState, Report, SurfaceKind, Window, Wire, Zone

MAP, BODY = "map", "base_link"
LIFT_M = 0.3  # height of lines above the ground
# The sources draw the largest zone dark green, the others light green.
BEST, OTHER = Color(r=0.0, g=0.4, b=0.1, a=1.0), Color(r=0.45, g=0.85, b=0.45, a=1.0)
WIRE, EXPECTED = Color(r=1.0, g=0.69, b=0.0, a=1.0), Color(r=1.0, g=0.69, b=0.0, a=0.4)
POINT_COLOURS = {
    PointState.SAFE: Color(r=0.1, g=0.5, b=1.0, a=0.9),
    PointState.UNSAFE: Color(r=0.9, g=0.1, b=0.1, a=0.9),
    PointState.UNKNOWN: Color(r=0.6, g=0.6, b=0.6, a=0.9),
}
FLOAT = PackedElementFieldNumericType.Float32
FIELDS = [PackedElementField(name=name, offset=4 * k, type=FLOAT) for k, name in enumerate("xyz")]


def channels(context: foxglove.Context) -> Mapping[str, Any]:
    """Return the channel of every topic of a recording."""
    raw = {
        journal.MAVLINK_IN: ("mavlink", Schema(name="mavlink.Frame", encoding="", data=b"")),
        journal.MAVLINK_OUT: ("mavlink", Schema(name="mavlink.Frame", encoding="", data=b"")),
        **dict.fromkeys(
            (journal.LIDAR, journal.ODOMETRY),
            ("slz.packets", Schema(name="slz.Packets", encoding="", data=b"")),
        ),
    }
    documents = (journal.EVENT, journal.REPORT, journal.GAP, PARAMETERS)
    anything = Schema(name="slz.Object", encoding="jsonschema", data=b'{"type": "object"}')
    return {
        **{t: Channel(t, message_encoding=e, schema=s, context=context) for t, (e, s) in raw.items()},
        **{t: Channel(t, message_encoding="json", schema=anything, context=context) for t in documents},
        POINTS: PointCloudChannel(POINTS, context=context),
        ZONES: SceneUpdateChannel(ZONES, context=context),
        MOVING: SceneUpdateChannel(MOVING, context=context),
        GEOJSON: GeoJsonChannel(GEOJSON, context=context),
        TRANSFORM: FrameTransformChannel(TRANSFORM, context=context),
        FIX: LocationFixChannel(FIX, context=context),
        LOG: LogChannel(LOG, context=context),
    }


def cloud(window: Window, at_ns: int) -> PointCloud:
    """Return a subset of a window's points in the map frame."""
    points = window.points_enu_m[:: max(1, len(window) // MOST_POINTS)].astype(np.float32)
    return PointCloud(
        timestamp=_stamp(at_ns), frame_id=MAP, point_stride=12, fields=FIELDS, data=points.tobytes()
    )


def scene(report: Report, at_ns: int, wind: Wind | None = None) -> SceneUpdate:
    """Return zones as outlines with labels, wires, the landing point as a sphere, its ways and the wind."""
    forget = Duration(sec=5)
    entities = [_zone(zone, rank, at_ns, forget) for rank, zone in enumerate(report.zones)]
    entities += [_wire(wire, at_ns, forget) for wire in report.wires]
    selected = report.selected
    if selected is not None:
        east, north = (float(v) for v in selected.enu_m[:2])
        up = float(np.nan_to_num(selected.height_m))
        ball = SpherePrimitive(
            pose=_pose(east, north, up),
            size=Vector3(x=1.0, y=1.0, z=1.0),
            color=POINT_COLOURS[selected.state],
        )
        entities.append(
            SceneEntity(
                timestamp=_stamp(at_ns), frame_id=MAP, id="landing point", lifetime=forget, spheres=[ball]
            )
        )
        if selected.corridors is not None:
            entities.append(ways(selected.corridors, _stamp(at_ns), MAP, forget))
        if wind is not None:
            entities.append(wind_arrow(wind, np.array([east, north, up]), _stamp(at_ns), MAP, forget))
    return SceneUpdate(entities=entities)


def moving(objects: tuple[MovingObject, ...], now_ns: int, at_ns: int) -> SceneUpdate:
    """Return what moves around the vehicle, at a time of the companion's clock and of the day."""
    return foxglove_moving.moving(objects, now_ns, _stamp(at_ns), MAP)


def _zone(zone: Zone, rank: int, at_ns: int, lifetime: Duration) -> SceneEntity:
    colour = OTHER if rank else BEST
    up = float(zone.best.enu_m[2]) + LIFT_M
    corners = [Point3(x=float(e), y=float(n), z=float(u) + LIFT_M) for e, n, u in zone.corners_enu_m]
    outline = LinePrimitive(
        type=LinePrimitiveLineType.LineLoop, points=corners, color=colour, thickness=3.0, scale_invariant=True
    )
    text = TextPrimitive(
        pose=_pose(float(zone.best.enu_m[0]), float(zone.best.enu_m[1]), up + 1.0),
        billboard=True,
        font_size=14.0,
        scale_invariant=True,
        color=colour,
        text=f"{zone.id}: {zone.area_m2:.0f} m2, {zone.best.certainty:.3f}{_surface(zone)}",
    )
    return SceneEntity(
        timestamp=_stamp(at_ns),
        frame_id=MAP,
        id=f"zone {zone.id}",
        lifetime=lifetime,
        lines=[outline],
        texts=[text],
    )


def _wire(wire: Wire, at_ns: int, lifetime: Duration) -> SceneEntity:
    """Return a wire as a line, fainter where it is extrapolated."""
    places, _, seen = wire.sampled(2.0)
    line = LinePrimitive(
        type=LinePrimitiveLineType.LineStrip,
        points=[Point3(x=float(e), y=float(n), z=float(u)) for e, n, u in places],
        colors=[WIRE if own else EXPECTED for own in seen],
        thickness=3.0,
        scale_invariant=True,
    )
    return SceneEntity(
        timestamp=_stamp(at_ns), frame_id=MAP, id=f"wire {wire.number}", lifetime=lifetime, lines=[line]
    )


def _surface(zone: Zone) -> str:
    surface = zone.best.surface
    return "" if surface.kind is SurfaceKind.UNKNOWN else f", {surface.text}"


def geojson(report: Report) -> GeoJson:
    """Return the zones as GeoJSON polygons, and the wires as lines."""
    features = [zone_feature(zone, report.grid, report.frame) for zone in report.zones]
    features += [wire_feature(wire, report.frame) for wire in report.wires]
    return GeoJson(geojson=json.dumps({"type": "FeatureCollection", "features": features}))


def transform(pose: VehiclePose, at_ns: int) -> FrameTransform:
    """Return the transform of the vehicle's body (forward, right, down) into the map (east, north, up)."""
    e, n, u = (float(v) for v in pose.position_enu_m)
    w, x, y, z = _quaternion(pose.rotation_enu_from_frd)
    return FrameTransform(
        timestamp=_stamp(at_ns),
        parent_frame_id=MAP,
        child_frame_id=BODY,
        translation=Vector3(x=e, y=n, z=u),
        rotation=Quaternion(x=x, y=y, z=z, w=w),
    )


def fix(pose: VehiclePose, frame: LocalFrame, at_ns: int) -> LocationFix:
    """Return the vehicle's geodetic position (WGS-84)."""
    lat, lon, alt = (float(v) for v in frame.lla(pose.position_enu_m))
    return LocationFix(timestamp=_stamp(at_ns), frame_id=BODY, latitude=lat, longitude=lon, altitude=alt)


def line(record: logging.LogRecord, at_ns: int) -> Log:
    """Return a line of the program's log."""
    levels = {"DEBUG": LogLevel.Debug, "WARNING": LogLevel.Warning, "ERROR": LogLevel.Error}
    level = levels.get(record.levelname, LogLevel.Fatal if record.levelno > logging.ERROR else LogLevel.Info)
    return Log(
        timestamp=_stamp(at_ns), level=level, message=record.getMessage(), name=record.name,
        file=record.filename, line=record.lineno,
    )  # fmt: skip


def _stamp(at_ns: int) -> Timestamp:
    return Timestamp(sec=at_ns // 1_000_000_000, nsec=at_ns % 1_000_000_000)


def _pose(east: float, north: float, up: float) -> Pose:
    return Pose(position=Vector3(x=east, y=north, z=up), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


def _quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = (float(v) for v in Rotation.from_matrix(rotation).as_quat())
    return w, x, y, z
