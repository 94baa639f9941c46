"""Read-only HTTP API of the flight: JSON schemas, described by OpenAPI."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from companion.flight.dashboard.freshness import NEVER, VERDICT

TITLE = "slz"
PAST = "Silent of autopilot, position, map, verdict: s since the last word, null: never; empty: all is live."
DESCRIPTION = (
    "What the landing companion knows. Read only: orders go through the page or MAVLink. Positions are metres"
    " east, north and up of the map's origin, or WGS-84 degrees in GeoJSON."
)


class Alarm(BaseModel):
    """Active alarm for the pilot."""

    level: Literal["critical", "warning"]
    key: str
    text: str


class Corridors(BaseModel):
    """Ways in and out of a point."""

    model_config = ConfigDict(extra="ignore")

    state: Literal["clear", "blocked", "unknown"] = Field(description="Of the best way.")
    overhead: Literal["clear", "blocked", "unknown"] = Field(description="Straight down.")
    bearings_deg: list[int] = Field(description="Bearings from the point at which a slope is clear.")


class Point(BaseModel):
    """Selected landing point."""

    model_config = ConfigDict(extra="ignore")

    enu_m: list[float | None] = Field(description="East, north, up.")
    state: Literal["safe", "unsafe", "unknown"]
    judged_by: Literal["near", "far", "none"]
    slope_deg: float | None
    relief_m: float | None
    certainty: float | None
    headings_deg: list[int] = Field(
        description="Headings at which the gear stands there, and rotor and tail are clear."
    )
    blocked_by: str | None = Field(None, description="What excludes other headings.")
    corridors: Corridors | None = Field(None, description="Ways in and out; none where they were not judged.")
    unseen: float | None = Field(description="Probability that a hazard there got no return.")
    surface: str | None = Field(description="Bare ground, water, roof, low vegetation or canopy.")
    surface_probability: float | None
    water: float | None = Field(description="Highest probability of water under the vehicle there.")
    raised_m: float | None = Field(description="Of a roof, over the ground around it.")
    zone: int | None


class Origin(BaseModel):
    """Origin of the map frame (WGS-84)."""

    lat_deg: float
    lon_deg: float
    alt_m: float


class Status(BaseModel):
    """State of the flight; null where unknown."""

    phase: str | None = Field(
        description="idle, survey, approach, descend, final, landed, climb, hold or failsafe."
    )
    mode: str | None = Field(description="The autopilot's flight mode.")
    connected: bool
    armed: bool | None
    lidar_ok: bool
    battery_pct: float | None
    position_enu_m: list[float | None] | None
    height_m: float | None = Field(description="Over the ground below.")
    zones: int = Field(description="Of the near map.")
    far_zones: int
    reports: int
    latency_ms: float | None = Field(
        description="Median age of the last window's returns when it was reported."
    )
    origin: Origin | None
    selected: Point | None
    alarms: list[Alarm]
    past: dict[str, float | None] = Field(description=PAST)


class Geometry(BaseModel):
    """Polygon or MultiPolygon (RFC 7946)."""

    type: Literal["Polygon", "MultiPolygon"]
    coordinates: list[Any]


class Feature(BaseModel):
    """Zone; its properties are those of `slz map`, and `map`: near or far.

    `surface`, `surface_probability`, `water` and `raised_m` are of its best point, as in `Point`. So is
    `corridors` of the ten best zones, with the ways in and out at the least slope, `slope_deg`: pairs of
    bearings (first, last) that are clear (`clear_deg`) or were not seen (`unknown_deg`), and what blocks the
    others (`blocked`: bearings_deg, least_slope_deg, height_m, distance_m, lat, lon).
    """

    type: Literal["Feature"]
    id: int
    geometry: Geometry
    properties: dict[str, Any]


class Zones(BaseModel):
    """Zones of the newest report, near map first, each map in its ranking."""

    type: Literal["FeatureCollection"]
    past: dict[str, float | None] = Field(description=PAST)
    features: list[Feature]


class LineOrPoint(BaseModel):
    """LineString with altitudes, or Point (RFC 7946)."""

    type: Literal["LineString", "Point"]
    coordinates: list[Any]


class Hazard(BaseModel):
    """Wire, or something that moves, by the property `kind`: wire or moving.

    A wire has the properties of the summary; its line goes on to where it is extrapolated. Something that
    moves has `speed_ms`, `course_deg` (clockwise from north), `radius_m` and `height_m`.
    """

    type: Literal["Feature"]
    id: str
    geometry: LineOrPoint
    properties: dict[str, Any]


class Hazards(BaseModel):
    """Wires of the newest report, and what moves now."""

    type: Literal["FeatureCollection"]
    past: dict[str, float | None] = Field(description=PAST)
    features: list[Hazard]


def status(
    state: dict[str, Any] | None, picture: dict[str, Any] | None, alarms: list[dict[str, str]], reports: int
) -> Status:
    """Return the status from the page's documents."""
    s, p = state or {}, picture or {}
    lat, lon, alt = p.get("frame", (None, None, None))
    known = s.get("east_m") is not None
    past = s.get("past", NEVER)
    judged = {"state": "unknown", "certainty": None} if VERDICT in past else {}
    return Status(
        phase=s.get("phase"),
        mode=s.get("mode"),
        connected=s.get("connected", False),
        armed=s.get("armed"),
        lidar_ok=s.get("lidar_ok", False),
        battery_pct=s.get("battery_pct"),
        position_enu_m=[s["east_m"], s["north_m"], s["up_m"]] if known else None,
        height_m=s.get("height_m"),
        zones=len(p.get("near", ())),
        far_zones=len(p.get("far", ())),
        reports=reports,
        latency_ms=p.get("latency_ms"),
        origin=None if lat is None else Origin(lat_deg=lat, lon_deg=lon, alt_m=alt),
        selected=None if p.get("selected") is None else Point(**p["selected"] | judged),
        alarms=[Alarm.model_validate(alarm) for alarm in alarms],
        past=dict(past),
    )
