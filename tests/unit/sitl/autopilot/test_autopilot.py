"""Simulated autopilot against measurements of ArduCopter."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.estimator import EstimateErrors, Estimator
from sitl.autopilot.guidance.mission_mode import Leg
from sitl.autopilot.modes import Mode
from sitl.vehicle.rigid_body import from_euler, to_euler
from tests.unit.sitl.bench_flight import Bench


def test_takes_off_to_the_height_asked_and_holds_it() -> None:
    bench = Bench().airborne(15)
    assert bench.truth.pos_enu_m[2] == pytest.approx(15, abs=0.5)
    before = bench.truth.pos_enu_m
    bench.run(10)
    np.testing.assert_allclose(bench.truth.pos_enu_m, before, atol=0.4)


def test_arming_waits_for_a_position_estimate() -> None:
    bench = Bench().run(1)
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_FAILED
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED) == mavlink.MAV_RESULT_FAILED
    bench.run(5)
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED) == 0
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0


def test_home_moves_to_the_arming_point() -> None:
    bench = Bench().run(6)
    bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.GUIDED)
    bench.autopilot.navigator.home_enu_m[:] = 99
    bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert np.abs(bench.autopilot.navigator.home_enu_m).max() < 1


@pytest.mark.parametrize("velocity", [(3.0, 0.0, 0.0), (0.0, -2.0, 0.0), (1.0, 1.0, 1.0), (0, 0, -1.0)])
def test_guided_follows_a_velocity_and_stops_three_seconds_after_the_last(
    velocity: tuple[float, float, float],
) -> None:
    bench = Bench().airborne(20)
    bench.run(6, lambda: bench.velocity(*velocity))
    np.testing.assert_allclose(bench.truth.vel_enu_ms, velocity, atol=0.25)
    bench.run(2.5)
    np.testing.assert_allclose(bench.truth.vel_enu_ms, velocity, atol=0.25)
    bench.run(4)
    np.testing.assert_allclose(bench.truth.vel_enu_ms, 0, atol=0.2)


def land_with(rate_hz: float, *, frame: int = 12, target: tuple[float, float] = (2.0, -1.5)) -> Bench:
    bench = Bench(EstimateErrors()).airborne(12)
    each = 1 / rate_hz
    bench.run(4, lambda: bench.landing_target(*target, frame=frame), each)
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.LAND) == 0
    while bench.vehicle.contact is None:
        bench.run(each, lambda: bench.landing_target(*target, frame=frame), each)
    return bench


def off_target(bench: Bench) -> float:
    """Return the distance from the target by the estimate, which drifts on after the touchdown."""
    assert bench.vehicle.contact is not None
    estimate = bench.autopilot.estimate
    assert estimate is not None
    return float(np.hypot(*(estimate.pos_enu_m[:2] - [2.0, -1.5])))


@pytest.mark.parametrize("rate_hz", [20.0, 3.0])
def test_lands_on_a_body_frd_target(rate_hz: float) -> None:
    bench = land_with(rate_hz)
    assert off_target(bench) < 0.2
    assert not bench.run(4).autopilot.armed
    assert bench.vehicle.contact is not None
    assert bench.vehicle.contact["sink_ms"] < 0.8


def test_a_target_at_one_and_a_half_hertz_is_never_believed() -> None:
    assert off_target(land_with(1.5)) > 1.5


@pytest.mark.parametrize("frame", [mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_GLOBAL])
def test_other_frames_are_refused_with_one_text(frame: int) -> None:
    bench = land_with(20, frame=frame)
    assert off_target(bench) > 1.5
    texts = [m.text for m in bench.sent if m.get_type() == "STATUSTEXT"]
    assert sum("Frame not supported" in str(text) for text in texts) == 1


def test_a_target_without_distance_is_dropped_silently() -> None:
    bench = Bench().airborne(10)
    for stamp in range(100):
        bench.tell(
            mavlink.MAVLink_landing_target_message(
                stamp, 0, 12, 0, 0, 0.0, 0, 0, 1.0, 1.0, 10.0, [1, 0, 0, 0], 2, 1
            )
        )
        bench.run(0.05)
    assert bench.autopilot.landing_target_enu_m is None


def test_intervals_up_to_200_hz_are_accepted() -> None:
    bench = Bench(tick_ns=2_500_000).run(1)
    number = mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 5000) == 0
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 2500) == mavlink.MAV_RESULT_DENIED
    bench.sent.clear()
    bench.run(2)
    assert sum(m.get_type() == "ATTITUDE_QUATERNION" for m in bench.sent) == pytest.approx(400, abs=4)


def test_timesync_answers_with_time_since_boot() -> None:
    bench = Bench().run(2)
    bench.autopilot.take_outgoing(bench.now_ns)
    bench.tell(mavlink.MAVLink_timesync_message(0, 12345))
    answers = [m for _, m in bench.autopilot.take_outgoing(bench.now_ns) if m.get_type() == "TIMESYNC"]
    assert answers[-1].ts1 == 12345
    assert answers[-1].tc1 == bench.now_ns + bench.autopilot.boot_offset_ns


def test_unknown_commands_are_unsupported_and_modes_without_number_fail() -> None:
    bench = Bench().run(6)
    assert bench.command(mavlink.MAV_CMD_USER_1, 1) == mavlink.MAV_RESULT_UNSUPPORTED
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 77) == mavlink.MAV_RESULT_FAILED


def test_parameters_are_listed_read_and_set() -> None:
    bench = Bench().run(1)
    bench.sent.clear()
    bench.tell(mavlink.MAVLink_param_request_list_message(1, 1)).run(0.1)
    values = {m.param_id: m for m in bench.sent if m.get_type() == "PARAM_VALUE"}
    assert len(values) == len(bench.autopilot.parameters) == values["PLND_ENABLED"].param_count
    bench.tell(mavlink.MAVLink_param_set_message(1, 1, b"WPNAV_SPEED", 300.0, 9)).run(0.1)
    assert bench.autopilot.parameters["WPNAV_SPEED"] == 300


def test_rtl_returns_and_lands_at_home() -> None:
    bench = Bench().airborne(10)
    bench.run(8, lambda: bench.velocity(3, 0, 0))
    assert bench.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == 0
    bench.run(90)
    assert np.hypot(*bench.truth.pos_enu_m[:2]) < 1.0
    assert not bench.autopilot.armed


def test_disarming_in_flight_needs_force() -> None:
    bench = Bench().airborne(10)
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mavlink.MAV_RESULT_FAILED
    assert bench.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196) == 0


def test_heading_follows_the_yaw_of_a_target() -> None:
    bench = Bench().airborne(10)
    bench.tell(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0b100111000111, 0, 0, 0, 0, 0, 0, 0, 0, 0, -2.0, 0
        )
    ).run(6)
    assert to_euler(bench.truth.quat_wxyz)[2] == pytest.approx(-2.0, abs=0.05)


def test_the_estimate_errs_as_configured_and_not_at_all_when_told() -> None:
    bench = Bench().run(2)
    errors = EstimateErrors(horizontal_m=0.5, position_tau_s=5.0)
    estimator = Estimator(np.random.default_rng(3), errors)
    off = [estimator.update(0.1, bench.truth).pos_enu_m - bench.truth.pos_enu_m for _ in range(20_000)]
    spread = np.std(off, axis=0)
    assert 0.2 < spread[0] < 0.7
    assert spread[2] < 0.2
    exact = Estimator(np.random.default_rng(3), EstimateErrors.none()).update(0.1, bench.truth)
    np.testing.assert_array_equal(exact.pos_enu_m, bench.truth.pos_enu_m)


@pytest.mark.parametrize("angles", [(0.3, -0.2, 3.0), (-0.1, 0.4, -1.5), (0, 0, np.pi - 1e-3)])
def test_euler_angles_go_round(angles: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(to_euler(from_euler(*angles)), angles, atol=1e-9)


def test_the_same_seed_flies_the_same_flight() -> None:
    first, second = (Bench(EstimateErrors(), seed=5).airborne(8).truth.pos_enu_m for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_every_message_it_knows_can_be_packed() -> None:
    bench = Bench().airborne(5)
    bench.autopilot.parameters.update({"FENCE_ENABLE": 1, "GPS2_TYPE": 1})
    bench.autopilot.navigator.mission.legs = [Leg(mavlink.MAV_CMD_NAV_LAND, 1, None)]
    bench.sent.clear()
    packer = mavlink.MAVLink(None, 1, 1)
    for number in bench.autopilot.telemetry.numbers:
        assert bench.autopilot.telemetry.send_once(number, 0)
    sent = [message for _, message in bench.autopilot.take_outgoing(bench.now_ns)]
    assert {m.get_msgId() for m in sent} >= set(bench.autopilot.telemetry.numbers)
    for message in sent:
        assert mavlink.MAVLink(None).decode(bytearray(message.pack(packer))).get_type() == message.get_type()


def test_the_first_touch_of_a_landing_is_the_touchdown_not_a_bounce() -> None:
    bench = Bench(EstimateErrors(), wind_ms=6, seed=0).airborne(8)
    assert bench.vehicle.contact is None
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, Mode.LAND) == 0
    bench.run(25)
    assert bench.vehicle.contact is not None
    assert bench.vehicle.contact["sink_ms"] > 0.3


def test_a_wall_stops_the_vehicle_and_does_not_lift_it() -> None:
    bench = Bench().airborne(10)
    heights = []
    for tick in range(3200):
        if tick % 20 == 0:
            bench.velocity(4, 0, 0)
        bench.ground_m = 18.0 if bench.truth.pos_enu_m[0] > 8 else 0.0
        heights.append(float(bench.truth.pos_enu_m[2]))
        bench.tick()
    assert max(np.diff(heights)) < 0.1
    collision = bench.vehicle.collision
    assert collision is not None
    assert collision["e"] == pytest.approx(8.0, abs=0.1)
    assert collision["u"] == pytest.approx(10.0, abs=0.5)
    assert bench.truth.pos_enu_m[2] == 0.0
    assert bench.vehicle.contact is None
