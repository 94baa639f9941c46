"""The campaign's plans, its file, its judgement of flights, and its report; nothing is flown."""

from __future__ import annotations

from math import gcd
from pathlib import Path
from typing import Any

import pytest

from companion.landing.situation import Phase
from tests.campaign import log, reactions, report
from tests.campaign.plan import CELLS, FAULTS, STATES, STRIDE, number_of, plan


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


def test_a_number_is_always_the_same_flight() -> None:
    assert plan(77) == plan(77)
    found = plan(number_of("lidar_stuck", Phase.FINAL, turn=3))
    assert (found.fault, found.state) == ("lidar_stuck", Phase.FINAL)


def test_a_reaction_is_stated_for_every_fault() -> None:
    assert set(reactions.TABLE) == set(FAULTS)


def test_a_campaign_goes_on_after_a_line_cut_short(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "flights.jsonl"
    assert log.read(path) == {}
    log.append(path, flight(number=3))
    path.write_text(path.read_text("utf-8") + '{"number": 4, "fau', "utf-8")
    assert set(log.read(path)) == {3}
    log.append(path, flight(number=4))
    log.append(path, flight(number=5))
    assert set(log.read(path)) == {3, 4, 5}


HELD = {"fault": "lidar_stop", "path": way("hold"), "landed": False, "phase": "hold"}


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ({}, ""),
        ({"safe": False}, "touched unsafe ground"),
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
