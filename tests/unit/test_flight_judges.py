"""The judges of campaign and search: a wrong verdict of theirs would hide an unsafe landing."""

from __future__ import annotations

import sys
from math import gcd
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.desk.evidence.artefact_file import read_artefact
from companion.runtime.program_version import program_version
from sitl import scenes
from sitl.truth.standing_gear import QUADCOPTER
from sitl.truth.touchdown import fault_of
from sitl.world.world import World
from tests.campaign import __main__ as campaign
from tests.campaign import reactions, report
from tests.campaign.plan import CELLS, FAULTS, STATES, STRIDE, plan
from tests.search import counts
from tests.search.flight import COARSE, SAFE, TAKEN, UNSAFE, Outcome, end_of
from tests.search.flights import Flier
from tests.search.margin import HazardClearance, margin_of, parts_of


def flight(path: list[list[Any]] | None = None, **more: Any) -> dict[str, Any]:
    """Return a flight that landed on its point and in which nothing went wrong."""
    return {
        "number": 1,
        "fault": "none",
        "state": "final",
        "scene": "landing_site",
        "began_s": 10.0,
        "ended_s": 20.0,
        "landed": True,
        "safe": True,
        "touchdown": {"t_ns": 25_000_000_000, "e": 0.0, "n": 0.0},
        "collision": None,
        "taken_by": "",
        "taken_s": 0.0,
        "over_s": None,
        "landed_by": "",
        "calls": [],
        "chosen": [0.0, 0.0],
        "aborts": [],
        "hands_off": 0,
        "phase": "landed",
        "mode": "LAND",
        "commands_while_pilot_flies": 0,
        "heard": [],
        "error": "",
        "cpu_s": 1.0,
        "path": path or way("final"),
    } | more


def way(phase: str, height_m: float = 8.0, speed_ms: float = 0.0) -> list[list[Any]]:
    return [[10 + k / 5, 0.0, 0.0, height_m, speed_ms, 0.0, "GUIDED", phase] for k in range(51)]


def test_every_fault_meets_every_state_once_in_each_turn() -> None:
    assert gcd(STRIDE, len(CELLS)) == 1
    for first in (0, 5 * len(CELLS)):
        plans = [plan(n) for n in range(first, first + len(CELLS))]
        assert {(p.fault, p.state) for p in plans} == {(f, s) for f in FAULTS for s in STATES}


def test_a_reaction_is_stated_for_every_fault() -> None:
    assert set(reactions.TABLE) == set(FAULTS)


def test_a_flight_is_recorded_with_its_judgement_and_the_program_s_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost = "SLZ: LiDAR lost: holding"
    monkeypatch.setattr(campaign, "fly", lambda p, _: flight(number=p.number, fault=p.fault, heard=[lost]))
    words = ["campaign", "--flights", "1", "--fault", "none", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit):
        campaign.main()
    flown = read_artefact(tmp_path / "flights.jsonl")
    assert flown.programs() == [program_version()]
    assert f"said '{lost}'" in flown.runs[0].what


HELD = {"fault": "lidar_stop", "path": way("hold"), "landed": False, "phase": "hold"}


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ({}, ""),
        ({"safe": False}, "touched unsafe ground"),
        (
            {"safe": False, "touchdown_fault": "stands at 19 degrees on its gear"},
            "stands at 19 degrees on its gear",
        ),
        ({"landed": False, "safe": None, "touchdown": None, "collision": {"e": 0.0, "n": 0.0}}, "collided"),
        ({"error": "RuntimeError: x"}, "RuntimeError: x"),
        ({"commands_while_pilot_flies": 2}, "2 commands in a mode of the pilot's"),
        ({"began_s": None, "ended_s": None}, "the state was never reached"),
        ({"heard": ["SLZ: LiDAR lost: holding"]}, "said 'SLZ: LiDAR lost: holding'"),
        ({"landed": False, "phase": "climb"}, "did not land: climb in LAND"),
        ({"fault": "lidar_stop", "path": way("final")}, "still in final after 3.5 s"),
        ({"fault": "lidar_stop", "path": way("climb")}, ""),
        ({"fault": "lidar_stop", "path": way("final", height_m=2.0)}, ""),
        ({"fault": "lidar_stop", "state": "survey", "path": way("survey", speed_ms=2.0)}, "still moves"),
        ({"fault": "lidar_stop", "state": "survey", "path": way("survey")}, ""),
        (HELD, "did not land"),
        (HELD | {"heard": ["take over"]}, ""),
        ({"fault": "pilot_mode", "path": way("final"), "landed": False}, "still in final at 12.0 s"),
        ({"fault": "pilot_mode", "path": way("idle"), "landed": False, "hands_off": 1}, ""),
        ({"fault": "killed", "state": "descend", "path": way("descend", speed_ms=2.0)}, "still moves"),
        ({"fault": "killed", "state": "descend", "path": way("final", speed_ms=2.0)}, ""),
        ({"fault": "link_duplicates", "hands_off": 1}, "gave the vehicle to a pilot"),
        ({"fault": "pilot_mode", "path": way("idle")}, "landed all the same"),
    ],
)  # fmt: skip
def test_a_flight_is_judged_by_what_was_seen_of_it(more: dict[str, Any], wrong: str) -> None:
    found = "; ".join(reactions.faults_of(flight(**more)))
    assert found.startswith(wrong)
    assert bool(found) == bool(wrong)


STICK = {
    "fault": "pilot_stick",
    "path": way("idle"),
    "taken_by": "pilot",
    "taken_s": 11.0,
    "landed_by": "pilot",
    "hands_off": 1,
    "heard": ["SLZ: pilot moves the sticks in LAND: hands off"],
}
GPS = {
    "fault": "gps_loss",
    "path": way("failsafe"),
    "taken_by": "failsafe",
    "taken_s": 11.0,
    "landed_by": "failsafe",
    "safe": False,
    "calls": ["SLZ: failsafe (position lost): LAND, take over"],
}


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        (STICK, ""),
        (STICK | {"safe": False}, ""),
        (STICK | {"path": way("final")}, "still in final 1.6 s after the stick moved it"),
        (STICK | {"path": way("final"), "touchdown": {"t_ns": 12_000_000_000, "e": 0.0, "n": 0.0}}, ""),
        (STICK | {"heard": []}, "did not say that it gave the vehicle to the pilot"),
        (STICK | {"hands_off": 0}, "did not say that it gave the vehicle to the pilot"),
        (STICK | {"commands_while_pilot_flies": 1}, "1 commands in a mode of the pilot's"),
        (STICK | {"taken_by": "", "landed_by": "", "hands_off": 0, "heard": []}, ""),
        (STICK | {"taken_by": "", "landed_by": "", "hands_off": 1}, ""),
        (GPS, ""),
        (GPS | {"landed_by": ""}, "touched unsafe ground"),
        (GPS | {"path": way("final")}, "in final 2.0 s after the failsafe took it"),
        (GPS | {"path": way("idle")}, "in idle 2.0 s after the failsafe took it"),
        (GPS | {"path": way("idle"), "over_s": 12.5}, ""),
        (GPS | {"path": way("final"), "over_s": 12.5}, "in final 2.0 s after the failsafe took it"),
        (GPS | {"path": way("idle", height_m=0.1)}, ""),
        (GPS | {"calls": []}, "did not call the pilot for ekf or position or gps or velocity"),
        (GPS | {"calls": ["SLZ: failsafe: LAND, take over"]}, "did not call the pilot for"),
        (GPS | {"commands_while_pilot_flies": 3}, "3 commands in the autopilot's failsafe"),
        (GPS | {"hands_off": 1}, "gave the vehicle to a pilot who had not touched it"),
        (GPS | {"taken_by": "", "landed_by": "", "safe": True}, ""),
        (GPS | {"taken_by": "", "landed_by": ""}, "touched unsafe ground"),
        (GPS | {"landed": False, "safe": None, "collision": {"e": 0.0, "n": 0.0}}, ""),
        (GPS | {"fault": "fence_breach"}, "did not call the pilot for fence"),
        (GPS | {"fault": "radio_failsafe", "calls": ["SLZ: failsafe (RC lost): RTL, take over"]}, ""),
    ],
)  # fmt: skip
def test_what_pilot_or_failsafe_do_is_their_own_and_commands_against_them_are_not(
    more: dict[str, Any], wrong: str
) -> None:
    found = "; ".join(reactions.faults_of(flight(**more)))
    assert found.startswith(wrong)
    assert bool(found) == bool(wrong)


def test_the_report_counts_and_draws_what_failed(tmp_path: Path) -> None:
    bad = flight(
        number=2,
        safe=False,
        path=[[10.0, 0.0, 0.0, 8.0, 0, 0, "LAND", "final"], [20.0, 3.0, 1.0, 0.0, 0, 0, "LAND", "landed"]],
    )
    assert report.write([flight(), bad], tmp_path) == 1
    text = (tmp_path / "report.md").read_text("utf-8")
    assert "2 flights, 2 with the fault begun in its state; **1 unsafe touchdowns or collisions**" in text
    assert "| none |  |  |  | 2/2 **!1** |  |" in text
    assert (tmp_path / "failures" / "2.png").stat().st_size > 10_000


def landed(there: World, e: float = 0.0, n: float = 0.0, heading_deg: float = 0.0, **more: Any) -> Any:
    """Return what is left of a simulation after a touchdown."""
    touchdown = {"e": e, "n": n, "heading_deg": heading_deg, "sink_ms": 0.8, "drift_ms": 0.0} | more
    return SimpleNamespace(
        scene=SimpleNamespace(world=there),
        log=SimpleNamespace(gear=QUADCOPTER),
        vehicle=SimpleNamespace(collision=None, truth=SimpleNamespace(pos_enu_m=np.array([e, n, 0.0]))),
        touchdown=touchdown,
        now_ns=0,
    )


def margin(simulation: Any) -> float:
    return margin_of(parts_of(simulation, HazardClearance(None)))


def test_its_sign_is_the_verdict_of_the_truth() -> None:
    rng = np.random.default_rng(5)
    there = scenes.build("landing_site", 3).world
    verdicts = []
    for _ in range(40):
        e, n, heading = (float(v) for v in rng.uniform((-40, -40, 0), (40, 40, 360)))
        simulation = landed(there, e, n, heading)
        unsafe = bool(fault_of(there, simulation.touchdown))
        assert (margin(simulation) < 0) == unsafe
        verdicts.append(unsafe)
    assert 3 < sum(verdicts) < 35


def test_an_unsafe_landing_is_counted_with_its_scenario(tmp_path: Path) -> None:
    unsafe = Outcome("unsafe", -0.2, -0.2, {"hazard": -0.2}, {}, [], None, 20.0, 1.0)
    found = counts.count(tmp_path / "counts.json", 3, Flier(COARSE, None, lambda *_, **__: unsafe))
    assert found["ends"]["unsafe"] == 3
    assert found["least_margin"] == -0.2
    assert [one["number"] for one in found["unsafe"]] == [0, 1, 2]


def test_what_was_unsafe_before_a_failsafe_took_over_is_the_companions() -> None:
    assert end_of(-0.1, 0.2, has_landed=True, descended=True) == TAKEN
    assert end_of(-0.1, -0.1, has_landed=True, descended=True) == UNSAFE
    assert end_of(-0.1, None, has_landed=True, descended=True) == UNSAFE
    assert end_of(0.2, None, has_landed=True, descended=True) == SAFE
