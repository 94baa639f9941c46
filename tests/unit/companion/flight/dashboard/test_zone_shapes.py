"""Zones for the page: their certainty classes, and outlines computed once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import params
from companion.flight.dashboard import zone_shapes
from companion.flight.dashboard.zone_shapes import ZoneShapes, certainty_class
from companion.flight.outputs.geojson_features import zone_polygon
from slz import SAFE, UNKNOWN, UNSAFE, Corridors, Report, SurfaceHere, SurfaceKind
from tests.unit.companion.flight.landing.flight import Flight, zone


def report(*ids: int) -> Report:
    found = Flight([zone(n, 5.0 * n, 0.0) for n in ids]).situation().report
    assert found is not None
    return found


@pytest.fixture
def outlined(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the numbers of the zones whose outlines are made, as they are."""
    made: list[int] = []

    def noted(of: Any, grid: Any) -> Any:
        made.append(of.id)
        return zone_polygon(of, grid)

    monkeypatch.setattr(zone_shapes, "zone_polygon", noted)
    return made


def test_a_zone_is_drawn_as_sure_as_it_is() -> None:
    parameters = params.load("quadcopter", ["confidence_factor=0.8", "uncertain_below=0.5"])
    drawn = [certainty_class(certainty, parameters) for certainty in (0.8, 0.79, 0.5, 0.49)]
    assert drawn == ["certain", "less", "less", "uncertain"]


def test_the_outline_of_a_zone_that_did_not_change_is_made_once(outlined: list[int]) -> None:
    pictures, parameters = ZoneShapes(), params.load()
    first = pictures.document(report(1, 2), parameters)
    again = pictures.document(report(2, 3), parameters)
    assert outlined == [1, 2, 3]
    assert again["near"][0]["rings"] == first["near"][1]["rings"]


def test_outlines_of_zones_long_gone_are_forgotten(
    monkeypatch: pytest.MonkeyPatch, outlined: list[int]
) -> None:
    monkeypatch.setattr(zone_shapes, "MOST_HELD", 2)
    pictures, parameters = ZoneShapes(), params.load()
    for ids in ((1, 2), (1, 3), (1, 2)):  # 2 was not looked at for longer than 1
        pictures.document(report(*ids), parameters)
    assert outlined == [1, 2, 3, 2]


def test_zones_and_the_landing_point_say_what_their_ground_is() -> None:
    roof = SurfaceHere(SurfaceKind.ROOF, 0.991, 0.04, 25.22)
    flight = Flight([zone(1, 5.0, 0.0, surface=roof), zone(2, 50.0, 0.0)])
    flight.selected, parameters = np.array([5.0, 0.0, 0.0]), params.load()
    found = flight.situation().report
    assert found is not None
    document = ZoneShapes().document(found, parameters)
    known = {"surface": "roof", "surface_probability": 0.991, "water": 0.04, "raised_m": 25.2}
    for place in (document["near"][0], document["selected"]):
        assert {name: place[name] for name in known} == known
    assert {name: document["near"][1][name] for name in known} == dict.fromkeys(known)
    assert document["selected"]["may_be_water"] is False
    wet = ZoneShapes().document(found, params.load("quadcopter", ["water_suspicion=0.03"]))
    assert wet["selected"]["may_be_water"] is True


def test_the_rose_tells_the_best_way_at_each_bearing() -> None:
    flight = Flight([zone(1, 5.0, 0.0)])
    flight.selected = np.array([5.0, 0.0, 0.0])
    found = flight.situation().report
    assert found is not None
    assert found.selected is not None
    states = np.full((72, 3), SAFE, np.uint8)  # at 30 and 60 degrees, and straight up
    states[1, 0], states[2, :2], states[3, :2], states[4, :2] = UNSAFE, UNSAFE, UNKNOWN, (UNSAFE, UNKNOWN)
    ways = Corridors(flight.selected, (30.0, 60.0, 90.0), states, np.zeros(72), np.full((72, 3), np.nan))
    judged = replace(found, selected=replace(found.selected, corridors=ways))
    rose = ZoneShapes().document(judged, params.load())["selected"]["rose"]
    assert rose["states"] == "ccbuu" + 67 * "c"
    assert rose["slopes_deg"] == [30.0, 60.0, None, None, None, *(67 * [30.0])]
    assert ZoneShapes().document(found, params.load())["selected"]["rose"] is None
