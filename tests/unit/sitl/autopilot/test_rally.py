"""The simulated autopilot's rally points, as measured on ArduCopter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.unit.sitl.bench_flight import Bench

RALLY = mavlink.MAV_MISSION_TYPE_RALLY


def heard(bench: Bench) -> list[Any]:
    return [m for _, m in bench.autopilot.take_outgoing(bench.now_ns) if m.get_type().startswith("MISSION_")]


def tell(bench: Bench, message: Any) -> list[Any]:
    bench.tell(message)
    return heard(bench)


def item(bench: Bench, number: int, east: float, north: float, *, frame: int = 3, alt: float = 20.0) -> Any:
    lat, lon, _ = bench.autopilot.lla(np.array([east, north, 0.0]))
    return mavlink.MAVLink_mission_item_int_message(
        1, 1, number, frame, 5100, 0, 1, 0, 0, 0, 0, round(lat * 1e7), round(lon * 1e7), alt, RALLY
    )


def count(number: int, kind: int = RALLY) -> Any:
    return mavlink.MAVLink_mission_count_message(1, 1, number, kind)


def give(bench: Bench, *places: tuple[float, float], alt: float = 20.0) -> None:
    answers = tell(bench, count(len(places)))
    for number, place in enumerate(places):
        assert [(m.get_type(), m.seq) for m in answers] == [("MISSION_REQUEST", number)]
        answers = tell(bench, item(bench, number, *place, alt=alt))
    assert [(m.get_type(), m.type, m.mission_type) for m in answers] == [("MISSION_ACK", 0, RALLY)]


def test_points_are_written_in_whole_metres_and_read_back_and_cleared() -> None:
    bench = Bench().run(1)
    bench.autopilot.take_outgoing(bench.now_ns)
    give(bench, (10.0, 20.0), (30.0, 0.0), alt=20.7)
    assert bench.autopilot.parameters["RALLY_TOTAL"] == 2
    listed = tell(bench, mavlink.MAVLink_mission_request_list_message(1, 1, RALLY))
    assert [(m.get_type(), m.count) for m in listed] == [("MISSION_COUNT", 2)]
    back = tell(bench, mavlink.MAVLink_mission_request_int_message(1, 1, 1, RALLY))[0]
    assert (back.get_type(), back.seq, back.frame, back.z) == ("MISSION_ITEM_INT", 1, 3, 20.0)
    tell(bench, mavlink.MAVLink_mission_clear_all_message(1, 1, RALLY))
    assert bench.autopilot.rally.items == []


def test_an_item_that_does_not_come_is_asked_for_again_and_given_up_in_the_end() -> None:
    bench = Bench().run(1)
    tell(bench, count(1))
    bench.sent.clear()
    bench.run(12)
    kinds = [m.get_type() for m in bench.sent if m.get_type().startswith("MISSION_")]
    assert kinds == ["MISSION_REQUEST"] * 7 + ["MISSION_ACK"]


def test_two_at_once_are_one_too_many() -> None:
    bench = Bench().run(1)
    tell(bench, count(1))
    second = count(2)
    second.pack(mavlink.MAVLink(None, 254, 190))
    bench.autopilot.receive(second, 0, bench.now_ns)
    assert [m.type for m in heard(bench)] == [mavlink.MAV_MISSION_DENIED]


@pytest.mark.parametrize(("frame", "result"), [(1, 2), (12, 2)])
def test_frames_that_are_not_global_are_refused(frame: int, result: int) -> None:
    bench = Bench().run(1)
    tell(bench, count(1))
    assert [m.type for m in tell(bench, item(bench, 0, 1, 1, frame=frame))] == [result]


@pytest.mark.parametrize(
    ("places", "end"),
    [
        ([(40.0, 0.0), (60.0, 5.0)], (40.0, 0.0)),  # the nearest
        ([(400.0, 0.0)], (0.0, 0.0)),  # beyond RALLY_LIMIT_KM
        ([(100.0, 0.0)], (0.0, 0.0)),  # home is nearer
    ],
)
def test_rtl_goes_to_the_nearest_of_rally_points_and_home(
    places: list[tuple[float, float]], end: tuple[float, float]
) -> None:
    bench = Bench().airborne(10)
    give(bench, *places, alt=22.0)
    bench.run(8, lambda: bench.velocity(3, 0, 0))
    assert bench.truth.pos_enu_m[0] > 20
    assert bench.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == 0
    top = 0.0
    for _ in range(90):
        bench.run(1)
        top = max(top, float(bench.truth.pos_enu_m[2]))
    assert np.hypot(*(bench.truth.pos_enu_m[:2] - end)) < 1.0
    assert top == pytest.approx(22.0 if end[0] else 15.0, abs=0.7)
    assert not bench.autopilot.armed
