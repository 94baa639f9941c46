"""GeoJSON feature of a zone: its ways in and out, and what is in the way."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from companion.flight.outputs.geojson_features import zone_feature
from slz import SAFE, UNSAFE, Corridors, Grid, LocalFrame
from tests.unit.companion.flight.landing.flight import zone

FRAME, GRID = LocalFrame(47.0, 8.0, 400.0), Grid(0.0, 0.0, 1.0, 10, 10)


def masted() -> Corridors:
    """Return the corridors of the point 5, 0, 0: clear but for a mast 12 m high, 20 m east of it."""
    states, least, tops = np.full((72, 3), SAFE, np.uint8), np.zeros(72), np.full((72, 3), np.nan)
    states[17:20, 0], least[17:20], tops[17:20] = UNSAFE, 38.2, (25.0, 0.0, 12.0)
    return Corridors(np.array([5.0, 0.0, 0.0]), (30.0, 60.0, 90.0), states, least, tops)


def properties(corridors: Corridors | None) -> Any:
    one = zone(1, 5.0, 0.0)
    feature = zone_feature(one if corridors is None else one.with_corridors(corridors), GRID, FRAME)
    return json.loads(json.dumps(feature))["properties"]


def test_a_feature_tells_the_clear_bearings_and_what_blocks_the_others() -> None:
    told = properties(masted())["corridors"]
    assert (told["state"], told["overhead"], len(told["bearings_deg"])) == ("clear", "clear", 72)
    assert (told["slope_deg"], told["clear_deg"], told["unknown_deg"]) == (30.0, [[100, 80]], [])
    (mast,) = told["blocked"]
    assert mast["bearings_deg"] == [85, 95]
    assert (mast["least_slope_deg"], mast["height_m"], mast["distance_m"]) == (38.2, 12.0, 20.0)
    lat, lon, _ = FRAME.lla(np.array([25.0, 0.0, 12.0]))
    assert (mast["lat"], mast["lon"]) == pytest.approx((lat, lon), abs=1e-8)


def test_ways_that_were_not_judged_are_null() -> None:
    assert properties(None)["corridors"] is None
