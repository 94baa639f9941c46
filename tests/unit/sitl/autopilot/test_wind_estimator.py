"""The simulated autopilot's wind estimate, and WIND as ArduPilot sends it."""

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.estimator import EstimateErrors
from sitl.vehicle.multirotor import DRAG_PER_S
from sitl.vehicle.wind_field import wind_profile
from tests.unit.sitl.bench_flight import Bench

UP_M = 20.0


def reported(bench: Bench) -> list[Any]:
    return [message for message in bench.sent if message.get_type() == "WIND"]


@pytest.mark.parametrize(("from_deg", "sent_deg"), [(90.0, 90.0), (200.0, -160.0), (315.0, -45.0)])
def test_wind_is_told_by_where_it_comes_from(from_deg: float, sent_deg: float) -> None:
    bench = Bench(wind_ms=6.0, wind_from_deg=from_deg, gust_ms=0.0)
    bench.autopilot.parameters["EK3_DRAG_MCOEF"] = DRAG_PER_S
    newest = reported(bench.airborne(UP_M))[-1]
    assert newest.direction == pytest.approx(sent_deg, abs=2)
    assert newest.speed == pytest.approx(6.0 * wind_profile(UP_M), rel=0.03)
    assert newest.speed_z == pytest.approx(0.0, abs=0.05)


def test_its_own_motion_is_no_wind() -> None:
    bench = Bench(wind_ms=6.0, wind_from_deg=90.0, gust_ms=0.0).airborne(UP_M)
    still = reported(bench)[-1]
    bench.run(12, lambda: bench.velocity(0, 5, 0))
    moving = reported(bench)[-1]
    assert moving.direction == pytest.approx(still.direction, abs=6)
    assert moving.speed == pytest.approx(still.speed, rel=0.1)


def test_it_is_sent_once_a_second_in_the_air_alone_and_as_often_as_asked() -> None:
    bench = Bench(wind_ms=3.0).run(4)
    assert reported(bench) == []
    bench.airborne(UP_M)
    before = len(reported(bench))
    assert len(reported(bench.run(5))) - before == pytest.approx(5, abs=1)
    bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_WIND, 200_000)
    before = len(reported(bench))
    assert len(reported(bench.run(5))) - before == pytest.approx(25, abs=2)


def test_without_a_drag_coefficient_arducopter_tells_no_wind() -> None:
    bench = Bench(wind_ms=5.0)
    bench.autopilot.parameters["EK3_DRAG_MCOEF"] = 0.0
    assert reported(bench.airborne(UP_M)) == []


def test_an_estimate_with_errors_stays_within_a_metre_per_second_on_average() -> None:
    bench = Bench(EstimateErrors(), wind_ms=5.0, wind_from_deg=0.0, seed=3).airborne(UP_M).run(60)
    north = [-m.speed * np.cos(np.radians(m.direction)) for m in reported(bench)[-60:]]
    assert np.mean(north) == pytest.approx(-5.0 * wind_profile(UP_M), abs=1.0)
