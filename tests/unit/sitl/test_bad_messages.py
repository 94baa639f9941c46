"""Invalid messages: refused and counted, without ending the simulation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.unit.sitl.bench_flight import Bench

NAN, INF = math.nan, math.inf


def ready() -> Bench:
    bench = Bench().run(6)
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4) == 0
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
    return bench


@pytest.mark.parametrize(
    ("command", "params"),
    [
        (mavlink.MAV_CMD_DO_SET_MODE, (NAN, 4)),
        (mavlink.MAV_CMD_DO_SET_MODE, (1, INF)),
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (NAN, 20000)),
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (30, INF)),
        (mavlink.MAV_CMD_REQUEST_MESSAGE, (NAN,)),
        (mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, 0, 0, 0, NAN)),
        (mavlink.MAV_CMD_DO_SET_HOME, (0, 0, 0, 0, NAN, NAN, NAN)),
        (mavlink.MAV_CMD_DO_SET_HOME, (0, 0, 0, 0, 47, 8, 1e30)),
        (mavlink.MAV_CMD_DO_SET_HOME, (0, 0, 0, 0, 91, 8, 400)),
        (mavlink.MAV_CMD_DO_REPOSITION, (0, 0, 0, 0, NAN, NAN, NAN)),
        (mavlink.MAV_CMD_DO_REPOSITION, (0, 0, 0, 0, 47, 181, 20)),
        (mavlink.MAV_CMD_CONDITION_YAW, (NAN,)),
    ],
)
def test_a_command_without_the_numbers_it_needs_is_denied(command: int, params: tuple[float, ...]) -> None:
    bench = ready()
    home = bench.autopilot.navigator.home_enu_m.copy()
    assert bench.command(command, *params) == mavlink.MAV_RESULT_DENIED
    bench.run(1)
    np.testing.assert_array_equal(bench.autopilot.navigator.home_enu_m, home)
    assert bench.autopilot.faults == 0


def test_a_takeoff_downwards_is_refused() -> None:
    bench = ready()
    assert bench.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, -5) == mavlink.MAV_RESULT_FAILED
    assert bench.run(1).vehicle.on_ground


def test_unused_parameters_may_be_nan_as_stations_send_them() -> None:
    bench = ready()
    assert bench.command(mavlink.MAV_CMD_NAV_TAKEOFF, NAN, NAN, NAN, NAN, NAN, NAN, 5) == 0


def test_a_stream_it_does_not_have_is_denied() -> None:
    number = mavlink.MAVLINK_MSG_ID_ODOMETRY
    result = Bench().run(1).command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 20000)
    assert result == mavlink.MAV_RESULT_DENIED


@pytest.mark.parametrize("value", [-1.0, 0.0, NAN, INF, 1e30])
def test_a_parameter_out_of_range_keeps_its_value_and_answers_with_it(value: float) -> None:
    bench = Bench().airborne(10)
    bench.sent.clear()
    bench.tell(mavlink.MAVLink_param_set_message(1, 1, b"WPNAV_ACCEL", value, 9)).run(2)
    answers = [m.param_value for m in bench.sent if m.get_type() == "PARAM_VALUE"]
    assert answers == [250.0]
    assert bench.truth.pos_enu_m[2] > 5


def test_a_landing_target_without_a_number_for_distance_is_dropped() -> None:
    bench = Bench().airborne(5)
    bench.tell(
        mavlink.MAVLink_landing_target_message(1, 0, 12, 0, 0, NAN, 0, 0, 1.0, 1.0, 5.0, [1, 0, 0, 0], 2, 1)
    )
    assert bench.autopilot.landing_target_enu_m is None


def test_a_handler_that_breaks_is_counted_and_the_flight_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench().airborne(5)

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(bench.autopilot.commands, "receive", broken)
    bench.velocity(1, 0, 0)
    assert bench.autopilot.faults == 1
    assert bench.run(1).truth.pos_enu_m[2] > 3


NUMBERS = st.one_of(
    st.floats(width=32), st.sampled_from([0.0, 1.0, 2.0, 4.0, 9.0, -1.0, NAN, INF, 3.4e38, 21196.0])
)
COMMANDS = (
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_DO_SET_HOME, mavlink.MAV_CMD_CONDITION_YAW,
)  # fmt: skip
FLIGHT = Bench()


@settings(max_examples=300, deadline=None)
@given(command=st.sampled_from(COMMANDS), params=st.lists(NUMBERS, min_size=7, max_size=7))
def test_no_numbers_in_a_command_break_it(command: int, params: list[float]) -> None:
    """The flight goes on from example to example: what one of them did must not break a later one."""
    if FLIGHT.now_ns == 0:
        ready_flight = FLIGHT.airborne(10)
        assert ready_flight.autopilot.armed
    FLIGHT.command(command, *params)
    FLIGHT.run(0.05)
    packer = mavlink.MAVLink(None, 1, 1)
    for message in FLIGHT.sent:
        message.pack(packer)
    FLIGHT.sent.clear()
    assert FLIGHT.autopilot.faults == 0
    assert np.isfinite(FLIGHT.truth.pos_enu_m).all()


@settings(max_examples=200, deadline=None)
@given(
    values=st.lists(NUMBERS, min_size=11, max_size=11),
    mask=st.integers(0, 4095),
    frame=st.sampled_from([1, 7, 8, 9]),
)
def test_no_numbers_in_a_target_break_it(values: list[float], mask: int, frame: int) -> None:
    if FLIGHT.now_ns == 0:
        FLIGHT.airborne(10)
    FLIGHT.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4)
    FLIGHT.tell(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *values))
    FLIGHT.run(0.05)
    assert FLIGHT.autopilot.faults == 0
    assert np.isfinite(FLIGHT.truth.pos_enu_m).all()
