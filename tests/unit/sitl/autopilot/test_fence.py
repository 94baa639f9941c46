"""The simulated autopilot's fence, as read in ArduCopter and flown."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.unit.sitl.bench_flight import Bench

FENCE = mavlink.MAV_MISSION_TYPE_FENCE
INSIDE, OUTSIDE = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
CIRCLE_INSIDE, CIRCLE_OUTSIDE = (
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)
MARGIN_M = 2.0
Corner = tuple[int, float, float, float]


def square(command: int, west: float, south: float, side: float) -> list[Corner]:
    corners = [(west, south), (west + side, south), (west + side, south + side), (west, south + side)]
    return [(command, 4, *corner) for corner in corners]


def flying(**parameters: float) -> Bench:
    bench = Bench(wind_ms=0.0)
    bench.autopilot.parameters.update({"FENCE_ENABLE": 1} | parameters)
    return bench.airborne(10)


def give(bench: Bench, items: list[Corner]) -> Any:
    """Upload items; return the answer to the last one."""
    bench.sent.clear()
    bench.tell(mavlink.MAVLink_mission_count_message(1, 1, len(items), FENCE)).run(0.05)
    for number, (command, value, east, north) in enumerate(items):
        request = next(m for m in bench.sent if m.get_type() == "MISSION_REQUEST")
        assert (request.seq, request.mission_type) == (number, FENCE)
        lat, lon, _ = bench.autopilot.lla(np.array([east, north, 0.0]))
        bench.sent.clear()
        bench.tell(
            mavlink.MAVLink_mission_item_int_message(
                1, 1, number, 3, command, 0, 1, value, 0, 0, 0, round(lat * 1e7), round(lon * 1e7), 0, FENCE
            )
        ).run(0.05)
    return next(m for m in bench.sent if m.get_type() == "MISSION_ACK")


def texts(bench: Bench) -> list[str]:
    return [m.text for m in bench.sent if m.get_type() == "STATUSTEXT"]


def east_m(bench: Bench) -> float:
    return float(bench.truth.pos_enu_m[0])


@pytest.mark.parametrize(
    ("parameters", "items", "limit_m"),
    [
        ({"FENCE_RADIUS": 20}, [], 20),
        ({"FENCE_RADIUS": 20, "FENCE_MARGIN_XY": 6}, [], 16),
        ({}, square(INSIDE, -15, -15, 30), 15),
        ({}, square(OUTSIDE, 15, -10, 20), 15),
        ({}, [(CIRCLE_INSIDE, 18, 0, 0)], 18),
        ({}, [(CIRCLE_OUTSIDE, 10, 25, 0)], 15),
    ],
)
def test_a_velocity_stops_at_the_margin_and_nothing_is_said(
    parameters: dict[str, float], items: list[Corner], limit_m: float
) -> None:
    bench = flying(**parameters)
    if items:
        assert give(bench, items).type == mavlink.MAV_MISSION_ACCEPTED
        assert bench.autopilot.parameters["FENCE_TOTAL"] == len(items)
    bench.sent.clear()
    bench.run(20, lambda: bench.velocity(3, 0, 0))
    assert east_m(bench) == pytest.approx(limit_m - MARGIN_M, abs=0.5)
    assert bench.autopilot.mode_name == "GUIDED"
    assert texts(bench) == []


def test_a_climb_and_a_sink_stop_at_the_margins_of_ceiling_and_floor() -> None:
    bench = flying(FENCE_TYPE=15, FENCE_ALT_MAX=20, FENCE_ALT_MIN=4)
    bench.run(12, lambda: bench.velocity(0, 0, 3))
    assert float(bench.truth.pos_enu_m[2]) == pytest.approx(18, abs=0.5)
    bench.run(20, lambda: bench.velocity(0, 0, -3))
    assert float(bench.truth.pos_enu_m[2]) == pytest.approx(6, abs=0.5)
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == 0
    bench.run(25)
    assert not bench.autopilot.armed  # a landing passes the floor
    assert not any("breached" in text for text in texts(bench))


def test_without_avoidance_the_areas_are_left_and_the_failsafe_returns() -> None:
    bench = flying(AVOID_ENABLE=0)
    give(bench, square(INSIDE, -10, -10, 20))
    bench.run(6, lambda: bench.velocity(3, 0, 0))
    assert bench.autopilot.mode_name == "RTL"
    assert "Polygon fence breached" in texts(bench)


@pytest.mark.parametrize(("options", "breached"), [(0, True), (2, False)])
def test_areas_of_inclusion_are_united_by_the_option(options: int, breached: bool) -> None:
    bench = flying(FENCE_OPTIONS=options, FENCE_ACTION=0)
    give(bench, [*square(INSIDE, -10, -10, 20), *square(INSIDE, 50, 50, 20)])
    bench.run(1)
    assert bool(bench.autopilot.failsafes.fence.breached) is breached


def test_items_that_make_no_area_are_refused_and_those_before_stay() -> None:
    bench = flying()
    give(bench, square(INSIDE, -10, -10, 20))
    assert give(bench, square(INSIDE, 0, 0, 5)[:3]).type == mavlink.MAV_MISSION_ERROR
    assert give(bench, [(16, 0, 0, 0)]).type == mavlink.MAV_MISSION_UNSUPPORTED
    assert len(bench.autopilot.failsafes.fence.items.items) == 4
    bench.sent.clear()
    bench.tell(mavlink.MAVLink_mission_request_list_message(1, 1, FENCE)).run(0.05)
    assert [m.count for m in bench.sent if m.get_type() == "MISSION_COUNT"] == [4]
    bench.tell(mavlink.MAVLink_mission_request_int_message(1, 1, 2, FENCE)).run(0.05)
    back = next(m for m in bench.sent if m.get_type() == "MISSION_ITEM_INT")
    assert (back.command, back.param1, back.mission_type) == (INSIDE, 4, FENCE)


def test_a_reboot_keeps_the_areas() -> None:
    bench = flying()
    give(bench, square(INSIDE, -10, -10, 20))
    bench.autopilot.reboot(0.1)
    assert len(bench.autopilot.failsafes.fence.items.items) == 4
