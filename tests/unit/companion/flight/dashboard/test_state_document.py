"""Wind and moving objects in the document of the page's state."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import params
from companion.flight.app import Companion
from companion.flight.dashboard import state_document
from companion.flight.dashboard.freshness import FIELDS, with_ages
from companion.flight.geometry.geofence import Boundary, Geofence
from companion.flight.geometry.wind import Wind
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensing import Sources
from companion.flight.sensors.diagnosis import explanation
from companion.flight.sensors.diagnosis.lidar_diagnosis import Episode, LidarDiagnosis
from slz import MovingObject, Nearby, Wire
from slz.wires.detected_wire import SaggingCurve
from tests.integration.link_bench import on_simulated_clock
from tests.unit.companion.flight.landing.flight import Flight, zone

S = 1_000_000_000
# What the companion itself knows is as old as the document.
OWN = {
    *("at_ns", "phase", "flying", "connected", "heard", "lidar_ok", "blind", "lidar_faults"),
    *("pipeline_failed", "no_commands", "key_mismatch", "unfit", "fence", "aim_enu_m", "aborts", "reboots"),
    *("past", "doing", "abort_does", "assist"),
}

SOURCES = Sources("livox:127.0.0.1:56301")


@on_simulated_clock
async def test_the_wind_is_shown_by_where_it_comes_from_and_unknown_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    try:
        monkeypatch.setattr(companion.deciding.situations, "situation", (flight := Flight([])).situation)
        assert state_document.state(companion.telling.view)["wind"] is None
        flight.wind = Wind(math.radians(359.8), 6.04, 9.26, "tilt")
        shown = state_document.state(companion.telling.view)["wind"]
    finally:
        companion.mapping.worker.close()
    assert shown == {"from_deg": 0, "speed_ms": 6.0, "gust_ms": 9.3, "source": "tilt"}


@on_simulated_clock
async def test_every_value_of_the_state_is_of_a_source_or_the_companion_s_own() -> None:
    """A new field needs a decision; both kinds of document have the same."""
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    try:
        flown = state_document.state(companion.telling.view)
        replayed = state_document.replayed(companion.sensing.history, VehicleState(), 0)
    finally:
        companion.mapping.worker.close()
    told = {field for fields in FIELDS.values() for field in fields}
    assert set(flown) == set(replayed) == told | OWN
    assert (
        flown["past"]
        == replayed["past"]
        == {"autopilot": None, "position": None, "map": None, "verdict": None}
    )
    assert {flown[field] for field in told} == {replayed[field] for field in told} == {None}


@on_simulated_clock
async def test_verdicts_end_where_the_position_is_lost_and_heights_over_ground_go_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    mapped = replace(companion.deciding.situations.situation(), lidar_ok=True, judged_ns=0, now_ns=0)
    shown = {}
    try:
        for lost in ("", "position"):
            then = replace(mapped, estimate_lost=lost)
            monkeypatch.setattr(companion.deciding.situations, "situation", partial(lambda s: s, then))
            shown[lost] = state_document.state(companion.telling.view)
    finally:
        companion.mapping.worker.close()
    assert not shown[""]["past"].keys() & {"map", "verdict"}
    assert shown["position"]["past"].keys() & {"map", "verdict"} == {"verdict"}
    assert shown["position"]["blind"] == "position lost"


@pytest.mark.parametrize("cut", [*FIELDS, "none"])
def test_a_silent_source_leaves_no_value_but_its_age(cut: str) -> None:
    """All fields, all sources: what a silent one told is gone, and nothing else."""
    told = {field for fields in FIELDS.values() for field in fields}
    sources = {name: (name != cut, 2 * S) for name in FIELDS}
    shown = with_ages(dict.fromkeys(told | OWN - {"past"}, "told"), 62 * S, sources)
    gone = set(FIELDS.get(cut, ()))
    assert {field for field, value in shown.items() if value is None} == gone
    assert shown["past"] == ({cut: 60.0} if cut in FIELDS else {})


@on_simulated_clock
async def test_the_fence_is_shown_with_the_zones_beyond_it(monkeypatch: pytest.MonkeyPatch) -> None:
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    flight = Flight([zone(1, 10, 0), zone(2, 33, 0)])
    square = Boundary(np.array([(-20.0, -20.0), (20, -20), (20, 20), (-20, 20)]), 0.0, True)
    try:
        assert state_document.state(companion.telling.view)["fence"] is None
        flight.fence = Geofence(
            Boundary(np.zeros((1, 2)), 25.0, True), (square,), margin_m=4.0, highest_m=46.04
        )
        monkeypatch.setattr(companion.deciding.situations, "situation", flight.situation)
        shown = state_document.state(companion.telling.view)["fence"]
    finally:
        companion.mapping.worker.close()
    assert shown == {
        "boundaries": [
            {"corners_m": [[0.0, 0.0]], "radius_m": 25.0, "inclusion": True},
            {"corners_m": square.corners_m.tolist(), "radius_m": 0.0, "inclusion": True},
        ],
        "margin_m": 4.0, "lowest_m": None, "highest_m": 46.0, "beyond": [2],
    }  # fmt: skip


@on_simulated_clock
async def test_what_is_wrong_with_the_lidar_is_shown_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    why = explanation.missing_sector(10.0, 80.0)
    try:
        assert state_document.state(companion.telling.view)["lidar_faults"] == []
        monkeypatch.setattr(LidarDiagnosis, "active", [Episode("missing_sector", why, 0)])
        shown = state_document.state(companion.telling.view)["lidar_faults"]
        replayed = state_document.replayed(
            companion.sensing.history, VehicleState(), 0, companion.sensing.lidar.diagnosis
        )
    finally:
        companion.mapping.worker.close()
    assert shown == replayed["lidar_faults"] == [{"cause": "missing_sector", "line": why.line}]
    assert why.remedy in shown[0]["line"]
    assert state_document.lidar_faults(None) == []


@on_simulated_clock
async def test_what_moves_is_shown_where_it_is_now(monkeypatch: pytest.MonkeyPatch) -> None:
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    try:
        monkeypatch.setattr(companion.deciding.situations, "situation", (flight := Flight([])).situation)
        assert state_document.state(companion.telling.view)["moving"] == []
        half_a_second_ago = flight.now_ns - 500_000_000
        walker = MovingObject(7, half_a_second_ago, np.array([4.0, 1.0]), np.array([-2.0, 0.0]), 0.31, 1.74)
        flight.moving = lambda _flight: (walker,)
        (shown,) = state_document.state(companion.telling.view)["moving"]
    finally:
        companion.mapping.worker.close()
    assert shown == {
        "number": 7, "enu_m": [3.0, 1.0], "velocity_ms": [-2.0, 0.0], "radius_m": 0.3, "height_m": 1.7,
    }  # fmt: skip


@on_simulated_clock
async def test_wires_are_shown_where_they_were_seen_and_where_they_go_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    curve = SaggingCurve(
        np.array([0.0, 5.0]), np.array([1.0, 0.0]), np.array([9.0, 0.0, 0.0]), np.eye(3), 0.1, 1.0
    )
    found = Flight([]).situation().report
    assert found is not None
    level = np.zeros((120, 120), np.float32)
    around = Nearby(-30.0, -30.0, 0.5, level, level, np.zeros(level.shape, bool))
    one = Wire(3, curve, -8.0, 8.0, -12.0, 8.0, (False, True), 20, 0, 0)
    try:
        monkeypatch.setattr(companion.deciding.situations, "situation", Flight([]).situation)
        assert state_document.state(companion.telling.view)["wires"] == []
        companion.mapping.latest.use_report(replace(found, wires=(one,), nearby=around))
        (shown,) = state_document.state(companion.telling.view)["wires"]
    finally:
        companion.mapping.worker.close()
    assert shown["enu_m"][0] == [-12.0, 5.0, 9.0]
    assert shown["enu_m"][-1] == [8.0, 5.0, 9.0]
    assert shown["seen"] == [False, True, True, True, True, True]
    assert shown["over_m"] == 9.0
