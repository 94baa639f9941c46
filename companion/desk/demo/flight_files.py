"""Files of a demonstration flight for the user: page, GeoJSON and recording."""

from __future__ import annotations

import json
import logging
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table

from companion.flight.app import Companion
from companion.flight.outputs.geojson_features import DEGREE_DECIMALS, zone_features
from companion.runtime import extras
from params import Parameters
from slz import Report, TerrainMaps

log = logging.getLogger(__name__)

PAGE, GEOJSON, RECORDING = "flight.html", "flight.geojson", "flight.mcap"
CHOSEN, TRUE, ESTIMATED = "chosen point", "touchdown, true", "touchdown, estimated"
Place = tuple[float, float, float]  # latitude, longitude (degrees), altitude (m)

BY_TRUTH = "(simulator's truth)"
BY_VEHICLE = "as the pilot is told: by the vehicle's own position, which errs"


@dataclass(frozen=True, slots=True)
class Moment:
    """State at a time: simulated seconds since the start, phase, height above home (m), place (WGS-84)."""

    at_s: float
    phase: str
    height_m: float | None
    lla: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True)
class Said:
    """Text to the pilot: simulated seconds since the start, MAV_SEVERITY, text."""

    at_s: float
    severity: int
    text: str


@dataclass(slots=True)
class Timeline:
    """Moments and texts in the order of time. Places are independent of the map frame, which may change."""

    moments: list[Moment] = field(default_factory=list)
    texts: list[Said] = field(default_factory=list)

    def note(self, at_s: float, companion: Companion) -> None:
        """Add the state of now."""
        now, frame = companion.deciding.situations.situation(), companion.sensing.history.frame
        place = None
        if now.position_enu_m is not None and frame is not None:
            lat, lon, alt = (float(v) for v in frame.lla(now.position_enu_m))
            place = lat, lon, alt
        height_m = now.height_above_home_m if math.isfinite(now.height_above_home_m) else None
        self.moments.append(Moment(at_s, companion.executive.phase.value, height_m, place))


@dataclass(frozen=True, slots=True)
class FlownMap:
    """Maps and last report of a flight, its log, and its points by name (WGS-84)."""

    maps: TerrainMaps
    report: Report
    parameters: Parameters
    log: Timeline
    points: dict[str, Place]


def remove(out: Path) -> None:
    """Remove the files of an earlier flight, which would pass for those of one that ended without them."""
    for name in (PAGE, GEOJSON, RECORDING):
        (out / name).unlink(missing_ok=True)


def points(summary: dict[str, Any], contact: dict[str, Any] | None) -> dict[str, Place]:
    """Return chosen point and touchdown by name; the touchdown twice, as estimated and by the truth.

    contact: touchdown of the simulator's truth, None without one.
    """
    places = {CHOSEN: summary["chosen"], ESTIMATED: summary["touchdown"]}
    found = {name: (p["lat"], p["lon"], p["alt_m"]) for name, p in places.items() if p is not None}
    if contact:
        found[TRUE] = contact["lat"], contact["lon"], contact["alt"]
    return found


def write(out: Path, flown: FlownMap | None, summary: dict[str, Any]) -> dict[str, str]:
    """Write page and GeoJSON beside the recording; return the files by kind. None: nothing was mapped."""
    files = {"page": out / PAGE, "geojson": out / GEOJSON, "recording": out / RECORDING}
    if flown is not None:
        document = {"type": "FeatureCollection", "features": _features(flown)}
        files["geojson"].write_text(json.dumps(document), "utf-8")
        if (package := extras.missing("survey")) is not None:
            log.warning(extras.explain("no page of the flight", package, "survey"))
        else:
            from companion.desk.demo.flight_page import write_page

            write_page(files["page"], flown, summary)
    return {kind: str(path) for kind, path in files.items() if path.exists()}


def _features(flown: FlownMap) -> list[dict[str, Any]]:
    """Return the zones as on the pilot's page, the flown path and the points; `kind` names each."""
    features = zone_features(flown.report)
    for zone in features:
        zone["properties"]["kind"] = "zone"
    path = [_lonlat(moment.lla) for moment in flown.log.moments if moment.lla is not None]
    if len(path) > 1:
        features.append(_feature("flown path", "LineString", path))
    return features + [_feature(name, "Point", _lonlat(place)) for name, place in flown.points.items()]


def _feature(kind: str, shape: str, coordinates: list[Any]) -> dict[str, Any]:
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "id": kind, "properties": {"kind": kind}, "geometry": geometry}


def _lonlat(place: Place) -> list[float]:
    lat, lon, alt = place
    return [round(lon, DEGREE_DECIMALS), round(lat, DEGREE_DECIMALS), round(alt, 2)]


def verdict(summary: dict[str, Any]) -> str:
    """Return the verdict in words."""
    good = summary["landed"] and summary["touchdown_safe"]
    return "landed on safe ground" if good else "did NOT land on safe ground"


def facts(summary: dict[str, Any]) -> dict[str, str]:
    """Return the figures in words, by name."""
    error, area = summary["touchdown_error_m"], summary["area_error"]
    tilt, own = summary["touchdown_tilt_deg"], summary["off_point_m"]
    return {
        "touchdown, true": "-" if error is None else f"{error:.2f} m from the chosen point {BY_TRUTH}",
        "touchdown, estimated": "-" if own is None else f"{own:.2f} m from it, {BY_VEHICLE}",
        "stands at": "-" if tilt is None else f"{tilt:.1f} degrees on its gear (truth)",
        **({"why unsafe": fault} if (fault := summary["touchdown_fault"]) else {}),
        "zones": f"{len(summary['zones'])} now, {summary['zones_seen']} in all",
        "area error, Eq. (20)": "-" if area is None else f"{area:.3f}",
        "unsafe ground called safe": f"{100 * summary['unsafe_as_safe']:.3f} % of the cells seen",
        "safe ground found": f"{100 * summary['recall']:.1f} %",
        "aborts": f"{summary['aborts']} {', '.join(summary['abort_reasons'])}".rstrip(),
        "ground seen to report": "p50 {p50} ms, p99 {p99} ms, max {max} ms".format(**summary["latency_ms"]),
        "flight": f"{summary['simulated_s']:.0f} s simulated in {summary['wall_s']:.0f} s",
    }


def table(summary: dict[str, Any]) -> Table:
    """Return verdict, figures and files as a table for the terminal."""
    title = f"{summary['scene']}, seed {summary['seed']}: {verdict(summary)}"
    shown = Table(title=title, show_header=False)
    files = {"maps": ", ".join(summary["maps"].values()) or "-", **summary["files"]}
    for name, value in (facts(summary) | files).items():
        shown.add_row(name, value)
    return shown
