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
from slz import Report, SurfaceHere, SurfaceKind
from slz.surface.surface_kinds import UNKNOWN_SURFACE
from tests.unit.companion.flight.landing.flight import FRAME, GRID, Flight, zone

ROOF = SurfaceHere(SurfaceKind.ROOF, 0.99123, 0.04, 25.22)
TOLD = {"surface": "roof", "surface_probability": 0.991, "water": 0.04, "raised_m": 25.2}


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
    assert surface_summary(surface) == dict(zip(TOLD, values, strict=True))


def test_features_and_points_hold_the_surface() -> None:
    found = report()
    assert only(TOLD, zone_feature(found.zones[0], GRID, FRAME)["properties"]) == TOLD
    assert only(TOLD, zone_feature(found.zones[1], GRID, FRAME)["properties"]) == dict.fromkeys(TOLD)
    assert found.selected is not None
    assert only(TOLD, point_summary(found.selected, FRAME)) == TOLD


def test_recordings_hold_the_surface_as_geojson_and_on_the_label() -> None:
    found = report()
    data = geojson(found).encode()
    features = json.loads(data[data.index(b"{") :])["features"]
    assert only(TOLD, features[0]["properties"]) == TOLD
    texts = repr(scene(found, 0))
    assert "1: 100 m2, 0.990, roof, 25 m up" in texts
    assert '2: 100 m2, 0.990"' in texts
