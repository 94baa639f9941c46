"""Modes, messages and parameters of the simulated PX4 on the wire."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.px4_modes import Px4Mode
from tests.unit.sitl.autopilot.px4.px4_flight import ACCEPTED, LOCAL_NED, NAN, REJECTED, VELOCITY, Px4Flight
from tests.unit.sitl.bench_flight import ORIGIN


@pytest.mark.parametrize(
    ("mode", "main", "sub", "title"),
    [
        (Px4Mode.MANUAL, 1, 0, "MANUAL"),
        (Px4Mode.POSCTL, 3, 0, "POSCTL"),
        (Px4Mode.AUTO_TAKEOFF, 4, 2, "AUTO.TAKEOFF"),
        (Px4Mode.AUTO_LOITER, 4, 3, "AUTO.LOITER"),
        (Px4Mode.AUTO_RTL, 4, 5, "AUTO.RTL"),
        (Px4Mode.AUTO_LAND, 4, 6, "AUTO.LAND"),
        (Px4Mode.AUTO_PRECLAND, 4, 9, "AUTO.PRECLAND"),
        (Px4Mode.OFFBOARD, 6, 0, "OFFBOARD"),
    ],
)
def test_custom_mode_is_main_and_sub_mode(mode: Px4Mode, main: int, sub: int, title: str) -> None:
    assert (mode >> 16 & 0xFF, mode >> 24, mode.title) == (main, sub, title)


def test_heartbeat_and_current_mode_tell_the_mode() -> None:
    flight = Px4Flight(3).run(1.1)
    beat, mode = flight.sent("HEARTBEAT")[-1], flight.sent("CURRENT_MODE")[-1]
    assert beat.autopilot == mavlink.MAV_AUTOPILOT_PX4
    assert beat.custom_mode == mode.custom_mode == mode.intended_custom_mode == Px4Mode.AUTO_LOITER
    assert beat.system_status == mavlink.MAV_STATE_ACTIVE
    assert mode.pack(mavlink.MAVLink(None, 1, 1))[7:10] == (436).to_bytes(3, "little")
    assert {"ESTIMATOR_STATUS", "MANUAL_CONTROL", "WIND_COV", "TIMESYNC"} <= {
        m.get_type() for m in flight.bench.sent
    }


def test_a_changed_mode_comes_at_once_in_current_mode_alone() -> None:
    flight = Px4Flight(3)
    assert flight.autopilot.set_mode(Px4Mode.AUTO_LAND)  # a command's answers are read before this
    flight.run(0.05)
    assert flight.sent("CURRENT_MODE")[-1].custom_mode == Px4Mode.AUTO_LAND
    assert len(flight.sent("HEARTBEAT")) <= 1


def test_heartbeat_keeps_its_rate_and_current_mode_comes_twice_a_second() -> None:
    flight = Px4Flight()
    ask = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    assert flight.command(ask, mavlink.MAVLINK_MSG_ID_HEARTBEAT, 200_000) == mavlink.MAV_RESULT_FAILED
    assert flight.command(ask, 436, 200_000) == ACCEPTED
    assert len(flight.forget().run(4).sent("CURRENT_MODE")) == pytest.approx(8, abs=1)


def test_a_landing_ends_disarmed_in_the_mode_before() -> None:
    flight = Px4Flight(2).enter(Px4Mode.AUTO_LAND)
    states = flight.until(lambda: not flight.autopilot.armed).landed_states()
    assert states[-2:] == [mavlink.MAV_LANDED_STATE_LANDING, mavlink.MAV_LANDED_STATE_ON_GROUND]
    assert flight.mode == "AUTO.LOITER"
    assert flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ACCEPTED


def test_modes_that_land_prevent_arming() -> None:
    flight = Px4Flight().enter(Px4Mode.AUTO_RTL)
    assert flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == REJECTED


def test_offboard_needs_a_stream_before_it() -> None:
    flight = Px4Flight(3)
    assert flight.ask(Px4Mode.OFFBOARD) == REJECTED
    flight.velocity = (2.0, 0.0, 0.0)
    flight.run(0.2).enter(Px4Mode.OFFBOARD).run(3)
    assert flight.bench.truth.vel_enu_ms == pytest.approx([2, 0, 0], abs=0.1)
    target = flight.sent("POSITION_TARGET_LOCAL_NED")[-1]
    assert (target.type_mask, target.vy) == (0b111, pytest.approx(2.0))


def test_offboard_flies_to_a_position() -> None:
    flight = Px4Flight(3)
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, LOCAL_NED, 0b110111111000, 2, 1, -4, *[0.0] * 8
    )
    flight.bench.tell(message)
    flight.enter(Px4Mode.OFFBOARD)
    for _ in range(60):
        flight.run(0.1).bench.tell(message)
    assert flight.bench.truth.pos_enu_m == pytest.approx([1, 2, 4], abs=0.1)


def test_a_setpoint_in_another_frame_is_refused_and_is_no_signal() -> None:
    flight = Px4Flight(3)
    for frame in (mavlink.MAV_FRAME_LOCAL_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD):
        flight.bench.tell(
            mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, VELOCITY, *[0.0] * 11)
        )
    assert flight.ask(Px4Mode.OFFBOARD) == REJECTED


def test_a_reposition_is_above_the_sea_in_every_frame() -> None:
    flight = Px4Flight(3)
    lat, lon, _ = flight.autopilot.lla(np.array([3.0, 0.0, 0.0]))
    flight.bench.tell(
        mavlink.MAVLink_command_int_message(
            1, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, NAN,
            round(lat * 1e7), round(lon * 1e7), ORIGIN[2] + 5,
        )
    )  # fmt: skip
    flight.run(6)
    assert flight.bench.truth.pos_enu_m == pytest.approx([3, 0, 5], abs=0.1)
    assert flight.command(mavlink.MAV_CMD_DO_REPOSITION, -1, 0) == mavlink.MAV_RESULT_UNSUPPORTED


@pytest.mark.parametrize(
    ("mode", "override", "taken"),
    [
        (Px4Mode.AUTO_LAND, 1, True),
        (Px4Mode.AUTO_LOITER, 0, False),
        (Px4Mode.OFFBOARD, 1, False),
        (Px4Mode.OFFBOARD, 2, True),
    ],
)
def test_moved_sticks_take_over_where_they_may(mode: Px4Mode, override: int, taken: bool) -> None:
    flight = Px4Flight(4, COM_RC_OVERRIDE=override)
    flight.velocity = (0.0, 0.0, 0.0)
    flight.run(0.2).enter(mode).run(0.5)
    flight.autopilot.receiver.transmitter[0] = 1700
    flight.run(0.2)
    assert (flight.mode == "POSCTL") is taken
    assert ("Pilot took over using sticks\t" in flight.texts()) is taken
    if taken:
        assert flight.autopilot.intended is Px4Mode.POSCTL
        before = flight.bench.truth.pos_enu_m
        flight.run(1)
        assert flight.away_m((float(before[0]), float(before[1]))) > 0.5


def test_integers_are_sent_by_their_bytes() -> None:
    flight = Px4Flight()

    def read(name: str) -> float:
        flight.forget().bench.tell(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
        (answer,) = flight.run(0.1).sent("PARAM_VALUE")
        whole = answer.param_type == mavlink.MAV_PARAM_TYPE_INT32
        value = float(answer.param_value)
        return float(struct.unpack("<i", struct.pack("<f", value))[0]) if whole else value

    assert read("PLD_MAX_SRCH") == 3
    assert read("PLD_BTOUT") == 5.0
    for kind, value in ((mavlink.MAV_PARAM_TYPE_REAL32, 2.0), (mavlink.MAV_PARAM_TYPE_INT32, 2.8e-45)):
        flight.bench.tell(mavlink.MAVLink_param_set_message(1, 1, b"RTL_PLD_MD", value, kind))
        flight.run(0.05)
        assert read("RTL_PLD_MD") == (1 if kind == mavlink.MAV_PARAM_TYPE_REAL32 else 2)


def test_texts_go_to_links_with_a_ground_station_alone() -> None:
    flight = Px4Flight(3)
    flight.bench.autopilot.add_link(1)
    flight.tell_target(mavlink.MAV_FRAME_BODY_FRD)
    links = [
        link
        for link, m in flight.autopilot.take_outgoing(flight.bench.now_ns)
        if m.get_type() == "STATUSTEXT"
    ]
    assert links == [0]


def test_the_peers_clock_dates_a_target_once_it_is_known() -> None:
    flight = Px4Flight()
    ahead_us = 7_000_000
    receive = flight.autopilot.navigator.precland

    def stamp(age_us: int) -> float:
        now_us = flight.autopilot.boot_ns // 1000
        message = mavlink.MAVLink_landing_target_message(
            now_us + ahead_us - age_us, 0, LOCAL_NED, 0, 0, 0, 0, 0, 1, 1, 0, [1, 0, 0, 0], 2, 1
        )
        flight.bench.tell(message)
        assert receive.target is not None
        return (flight.bench.now_ns - receive.target.stamp_ns) / 1e9

    assert stamp(2_000_000) == 0.0
    for _ in range(510):
        boot_ns = flight.autopilot.boot_ns
        flight.bench.tell(mavlink.MAVLink_timesync_message(boot_ns + 1000 * ahead_us, boot_ns))
        flight.bench.tick()
    assert stamp(2_000_000) == pytest.approx(2.0, abs=0.02)
