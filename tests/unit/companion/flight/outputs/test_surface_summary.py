"""Surfaces of zones and points in JSON, GeoJSON and Foxglove's scene."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from companion.flight.outputs.geojson_features import zone_feature
from companion.flight.outputs.report_summary import point_summary, surface_summary
from companion.flight.recorder.foxglove_scene import geojson, scene
from slz import SAFE, UNSAFE, Corridors, Grid, LocalFrame, Report, SurfaceHere, SurfaceKind
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from tests.unit.companion.flight.landing.flight import FRAME, GRID, Flight, zone

ROOF = SurfaceHere(SurfaceKind.ROOF, 0.99123, 0.04, 25.22)
NUMBERED = {"surface": "roof", "surface_probability": 0.991, "water": 0.04, "raised_m": 25.2}


def report() -> Report:
    flight = Flight([zone(1, 5.0, 0.0, surface=ROOF), zone(2, 50.0, 0.0)])
    flight.selected = np.array([5.0, 0.0, 0.0])
    found = flight.situation().report
    assert found is not None
    return found


def only(names: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    return {name: document[name] for name in names}


@pytest.mark.parametrize(
    ("surface", "values"),
    [
        (ROOF, ("roof", 0.991, 0.04, 25.2)),
        (SurfaceHere(SurfaceKind.BARE, 0.9, 0.02), ("bare ground", 0.9, 0.02, None)),
        (SurfaceHere(SurfaceKind.BARE, math.nan), ("bare ground", None, 0.0, None)),
        (UNKNOWN_SURFACE, (None, None, None, None)),
        (SurfaceHere(SurfaceKind.UNKNOWN, water=0.3), (None, None, 0.3, None)),
    ],
)
def test_nothing_unknown_is_given_as_a_number(surface: SurfaceHere, values: tuple[Any, ...]) -> None:
    assert surface_summary(surface) == dict(zip(NUMBERED, values, strict=True))


def test_features_and_points_hold_the_surface() -> None:
    found = report()
    assert only(NUMBERED, zone_feature(found.zones[0], GRID, FRAME)["properties"]) == NUMBERED
    assert only(NUMBERED, zone_feature(found.zones[1], GRID, FRAME)["properties"]) == dict.fromkeys(NUMBERED)
    assert found.selected is not None
    assert only(NUMBERED, point_summary(found.selected, FRAME)) == NUMBERED


def test_recordings_hold_the_surface_as_geojson_and_on_the_label() -> None:
    found = report()
    data = geojson(found).encode()
    features = json.loads(data[data.index(b"{") :])["features"]
    assert only(NUMBERED, features[0]["properties"]) == NUMBERED
    texts = repr(scene(found, 0))
    assert "1: 100 m2, 0.990, roof, 25 m up" in texts
    assert '2: 100 m2, 0.990"' in texts


# GeoJSON feature of a zone: its ways in and out, and what is in the way.


ZONE_FEATURE_FRAME, ZONE_FEATURE_GRID = LocalFrame(47.0, 8.0, 400.0), Grid(0.0, 0.0, 1.0, 10, 10)


def masted() -> Corridors:
    """Return the corridors of the point 5, 0, 0: clear but for a mast 12 m high, 20 m east of it."""
    states, least, tops = np.full((72, 3), SAFE, np.uint8), np.zeros(72), np.full((72, 3), np.nan)
    states[17:20, 0], least[17:20], tops[17:20] = UNSAFE, 38.2, (25.0, 0.0, 12.0)
    return Corridors(np.array([5.0, 0.0, 0.0]), (30.0, 60.0, 90.0), states, least, tops)


def properties(corridors: Corridors | None) -> Any:
    one = zone(1, 5.0, 0.0)
    feature = zone_feature(
        one if corridors is None else one.with_corridors(corridors), ZONE_FEATURE_GRID, ZONE_FEATURE_FRAME
    )
    return json.loads(json.dumps(feature))["properties"]


def test_a_feature_tells_the_clear_bearings_and_what_blocks_the_others() -> None:
    told = properties(masted())["corridors"]
    assert (told["state"], told["overhead"], len(told["bearings_deg"])) == ("clear", "clear", 72)
    assert (told["slope_deg"], told["clear_deg"], told["unknown_deg"]) == (30.0, [[100, 80]], [])
    (mast,) = told["blocked"]
    assert mast["bearings_deg"] == [85, 95]
    assert (mast["least_slope_deg"], mast["height_m"], mast["distance_m"]) == (38.2, 12.0, 20.0)
    lat, lon, _ = ZONE_FEATURE_FRAME.lla(np.array([25.0, 0.0, 12.0]))
    assert (mast["lat"], mast["lon"]) == pytest.approx((lat, lon), abs=1e-8)


def test_ways_that_were_not_judged_are_null() -> None:
    assert properties(None)["corridors"] is None
