"""Wires in the summary, in GeoJSON and in recordings."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from companion.flight.outputs.geojson_features import hazard_features, wire_feature, wire_summary
from companion.flight.recorder.journal import report_document
from slz import LocalFrame, Wire
from slz.wires.detected_wire import SaggingCurve
from tests.unit.companion.flight.landing.flight import Flight

FRAME = LocalFrame(47.0, 8.0, 400.0)
CURVE = SaggingCurve(
    np.array([0.0, 5.0]), np.array([1.0, 0.0]), np.array([9.0, 0.0, 0.002]), np.eye(3) * 1e-4, 0.1, 1.0
)
WIRE = Wire(3, CURVE, -20.0, 20.0, -25.0, 40.0, (True, False), 57, 1, 2)


def test_the_summary_holds_ends_and_what_is_extrapolated() -> None:
    told = wire_summary(WIRE, FRAME)
    assert told["number"] == 3
    assert told["length_m"] == 40.0
    assert told["extrapolated_m"] == [5.0, 20.0]
    assert told["at_support"] == [True, False]
    assert told["ends"][0]["alt_m"] == pytest.approx(409.8, abs=0.02)


def test_the_feature_is_a_line_in_longitude_latitude_and_altitude() -> None:
    told = json.loads(json.dumps(wire_feature(WIRE, FRAME)))
    line = told["geometry"]["coordinates"]
    assert told["geometry"]["type"] == "LineString"
    expected = FRAME.lla([-25.0, 5.0, 9.0 + 0.002 * 625])
    assert line[0] == pytest.approx([expected[1], expected[0], expected[2]], abs=0.01)
    assert len(line) == 14


def test_recordings_hold_the_wires_of_a_report() -> None:
    found = Flight([]).situation().report
    assert found is not None
    assert json.loads(report_document(found))["wires"] == []
    (told,) = json.loads(report_document(replace(found, wires=(WIRE,))))["wires"]
    assert told["heights"] == [9.0, 0.0, 0.002]
    assert told["from_to_m"] == [-25.0, 40.0]


def test_hazards_are_wires_as_lines_and_what_moves_as_points() -> None:
    walker = {
        "number": 7,
        "enu_m": [10.0, 20.0],
        "velocity_ms": [-1.5, 0.0],
        "radius_m": 0.3,
        "height_m": 1.7,
    }
    wire, moving = json.loads(json.dumps(hazard_features([WIRE], [walker], FRAME)))
    assert wire["properties"]["kind"] == "wire"
    expected = FRAME.lla([10.0, 20.0, 0.0])
    assert moving["geometry"] == {
        "type": "Point",
        "coordinates": pytest.approx([expected[1], expected[0]], abs=1e-6),
    }
    told = moving["properties"]
    assert (told["kind"], told["course_deg"], told["speed_ms"]) == ("moving", 270, 1.5)
