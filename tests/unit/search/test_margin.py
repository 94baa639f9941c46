"""Margin to an unsafe touchdown: its sign is the simulator's verdict, its size the distance from it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sitl import scenes
from sitl.truth.standing_gear import QUADCOPTER
from sitl.truth.touchdown import fault_of
from sitl.world.primitives import Box, Ellipsoid, Ground, Kind, Solid
from sitl.world.world import World
from tests.search.hazard import FROM_M, Hazard
from tests.search.margin import (
    HazardClearance,
    clearance_m,
    margin_of,
    missed_m_deg,
    parts_of,
    response_of,
    score_of,
)
from tests.search.scenario import Scenario
from tests.search.troubles import troubles

S = 1_000_000_000
BOX = Box(0.0, 0.0, 0.0, 2.0, 1.0, 1.5)


def world(*solids: Solid, kind: Kind = Kind.GRASS) -> World:
    return World(Ground(-10.0, -10.0, 1.0, np.zeros((21, 21)), np.full((20, 20), kind, np.uint8)), solids)


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


def test_level_ground_leaves_all_but_the_speed() -> None:
    parts = parts_of(landed(world()), HazardClearance(None))
    assert parts == {"hazard": 1.0, "place": 1.0, "slope": 1.0, "relief": 1.0, "gear": 1.0, "speed": 0.8}
    assert margin_of(parts) == 0.8


def test_the_margin_falls_towards_a_box_and_is_negative_at_it() -> None:
    there = world(BOX)
    margins = [margin(landed(there, e)) for e in (4.5, 3.0, 2.5, 2.1, 1.8, 0.0)]
    assert margins == sorted(margins, reverse=True)
    assert margins[2] > 0 > margins[4]
    assert parts_of(landed(there, 1.8), HazardClearance(None))["place"] < 0


def test_water_is_unsafe_though_it_is_level() -> None:
    assert margin(landed(world(kind=Kind.WATER))) < 0


def test_a_hard_touchdown_is_nearer_to_the_limit() -> None:
    assert margin(landed(world(), sink_ms=3.8)) == pytest.approx(0.05)


def test_a_collision_is_unsafe_wherever_it_is() -> None:
    simulation = landed(world())
    simulation.vehicle.collision, simulation.touchdown = {"speed_ms": 2.0}, None
    assert margin(simulation) == pytest.approx(-0.6)


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


@pytest.mark.parametrize(
    ("feet", "clear_m"),
    [
        ((3.45, 0.0, 0.0), 2.0),  # aside
        ((0.0, 0.0, 4.0), 2.5),  # above
        ((1.75, 0.0, 1.9), 0.5),  # 0.3 m aside of the edge of its top, and 0.4 m above that
        ((0.0, 0.0, 1.4), -0.1),  # in it
    ],
)
def test_clearance_of_a_box(feet: tuple[float, float, float], clear_m: float) -> None:
    assert clearance_m(np.array(feet), BOX) == pytest.approx(clear_m, abs=1e-9)


def test_clearance_of_a_ball_and_of_a_box_that_hangs() -> None:
    ball = Ellipsoid(0.0, 0.0, 0.5, 0.5, 0.5, 0.5)
    assert clearance_m(np.array([0.0, 1.95, 0.0]), ball) == pytest.approx(1.0)
    assert clearance_m(np.array([0.0, 0.0, 0.0]), Box(0.0, 0.0, 2.3, 2.0, 2.0, 1.0)) == pytest.approx(2.0)


def test_the_least_clearance_is_kept_until_the_touchdown() -> None:
    there = world()
    hazard = Hazard(Scenario.of(hazard="box", hazard_from_deg=90.0, hazard_speed_ms=5.0), (0.0, 0.0))
    simulation = landed(there)
    simulation.autopilot = SimpleNamespace(estimate=None)
    simulation.scene = SimpleNamespace(world=there)
    clearance = HazardClearance(hazard)
    hazard.start(simulation)
    hazard.started_ns = 0
    simulation.touchdown = None
    distances = []
    for now_s in (0.0, 0.5, 1.0):
        hazard.move(simulation, now_s)
        simulation.now_ns = round(now_s * 1e9)
        clearance(simulation)
        distances.append(clearance.least_m)
    assert distances[0] == pytest.approx(FROM_M - 0.5 - 0.45)
    assert distances[1] == pytest.approx(FROM_M - 2.5 - 0.5 - 0.45)
    assert distances[2] < 0
    before = HazardClearance(hazard)
    simulation.touchdown = {}
    before(simulation)
    assert math.isinf(before.least_m)


def test_a_hazard_is_beside_the_ordered_point_wherever_the_landing_target_is() -> None:
    scenario = Scenario.of(hazard="box", hazard_aside_m=2.0, hazard_aside_deg=90.0, hazard_speed_ms=5.0)
    true, known = (SimpleNamespace(pos_enu_m=np.array([e, 0.0, 4.0])) for e in (0.5, 0.2))
    for ordered, east_m in (((1.0, 3.0), 3.3), (None, 9.0)):
        there, hazard = world(), Hazard(scenario, ordered)
        simulation: Any = SimpleNamespace(
            scene=SimpleNamespace(world=there),
            vehicle=SimpleNamespace(truth=true),
            autopilot=SimpleNamespace(estimate=known),
        )
        hazard.goal = 7.0, 3.0  # of the landing target
        hazard.start(simulation)
        hazard.move(simulation, 60.0)
        mover = there.movers[Hazard.what]
        assert (mover.x_m, mover.y_m) == pytest.approx((east_m, 3.0))


def test_the_score_tells_more_than_the_margin() -> None:
    calm, near = {"hazard": 1.0, "speed": 0.8}, {"hazard": 0.9, "speed": 0.8}
    assert margin_of(calm) == margin_of(near)
    assert score_of(near, {}) < score_of(calm, {})
    assert score_of(calm, {"reaction": 0.2}) < score_of(calm, {"reaction": 0.9}) < score_of(calm, {})


def test_the_response_is_the_time_to_react_and_the_distance_from_the_point_as_the_autopilot_knew() -> None:
    flying: Any = SimpleNamespace(touchdown=None)
    there, aside = (
        Hazard(Scenario.of(hazard="box", hazard_speed_ms=5.0, hazard_aside_m=m), None) for m in (0.0, 4.0)
    )
    silence = troubles(Scenario.of(fault="lidar_stop", fault_s=2.0), np.random.default_rng(0))["lidar_stop"]
    assert response_of(flying, there, silence, 5 * S, None) == {}
    there.started_ns = aside.started_ns = silence.begun_ns = 10 * S  # they come 5 m at 5 m/s
    assert response_of(flying, there, silence, None, None) == {}
    assert response_of(flying, aside, None, 12 * S, None) == {}
    assert response_of(flying, there, None, 9 * S, None) == {}  # to something else
    for reacted_s, left in ((10.4, 1.2), (12.5, 0.5), (20.0, -1.0)):
        assert response_of(flying, there, None, round(reacted_s * S), None) == {"reaction": left}
    assert response_of(flying, None, silence, round(11.5 * S), None) == {"silence": 0.5}
    assert response_of(flying, None, silence, 13 * S, None) == {}  # of something else

    there_m, known_m = (SimpleNamespace(pos_enu_m=np.array([e, 0.0, 0.0])) for e in (1.2, 0.6))
    touched: Any = SimpleNamespace(
        touchdown={"e": 1.2, "n": 0.0},
        autopilot=SimpleNamespace(estimate=known_m),
        vehicle=SimpleNamespace(truth=there_m),
    )
    assert missed_m_deg(touched, (0.0, 0.0)) == (0.6, 90.0)
    assert missed_m_deg(touched, (0.6, 1.0)) == (1.0, 180.0)
    assert missed_m_deg(flying, (0.0, 0.0)) is None
    assert response_of(touched, None, None, None, (0.6, 90.0)) == {"accuracy": 0.75}
    assert response_of(touched, None, None, None, None) == {}
