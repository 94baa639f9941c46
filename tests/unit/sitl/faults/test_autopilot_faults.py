"""Faults of the autopilot: reboot, moved estimate, pilot's input, other systems on the link."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import faults, scenes
from sitl.autopilot.airframe import Kind
from sitl.autopilot.modes import Mode
from sitl.simulation import Simulation
from sitl.wire.wire import MemoryWire
from tests.unit.sitl.wire.test_wire import COMPANION, Station

HEIGHT_M = 5.0


def fault(name: str, seed: int = 1) -> faults.Fault:
    return faults.build(name, np.random.default_rng(seed))


@pytest.fixture
def hovering(request: pytest.FixtureRequest) -> tuple[Simulation, Station]:
    """Return a vehicle in GUIDED at five metres, and a companion's end that hears it; parameter: the tick."""
    end = Station(1, COMPANION)
    sim = Simulation(
        scenes.build("landing_site", 1),
        [end.wire],
        pilot_height_m=HEIGHT_M,
        ready_after_s=0.1,
        tick_ns=getattr(request, "param", 10_000_000),
        wind_ms=0.0,
        parameters={"WPNAV_SPEED_UP": 500.0},
    )
    sim.run(10.0)
    assert sim.autopilot.mode is Mode.GUIDED
    assert sim.autopilot.height_above_home_m > HEIGHT_M - 0.6
    end.wire.received.clear()
    return sim, end


def during(sim: Simulation, each: faults.Fault, seconds: float) -> None:
    each.start(sim)
    sim.every_tick.append(each.on_tick)
    sim.run(seconds)
    sim.every_tick.remove(each.on_tick)
    each.stop(sim)


def messages(end: Station) -> list[Any]:
    codec = mavlink.MAVLink(None)
    return codec.parse_buffer(bytearray(b"".join(end.wire.received))) or []


def test_a_reboot_is_silent_for_two_seconds_and_then_counts_from_zero(
    hovering: tuple[Simulation, Station],
) -> None:
    sim, end = hovering
    before_m = sim.vehicle.truth.pos_enu_m
    during(sim, fault("reboot"), 1.9)
    assert [m for m in messages(end) if m.get_srcSystem() == 1] == []
    sim.run(2.0)
    heard = messages(end)
    assert {m.get_type() for m in heard} >= {"HEARTBEAT", "GLOBAL_POSITION_INT"}
    assert min(m.time_boot_ms for m in heard if m.get_type() == "GLOBAL_POSITION_INT") < 2200
    assert sim.autopilot.armed
    assert np.linalg.norm(sim.vehicle.truth.pos_enu_m - before_m) < 1.0


def test_a_reset_estimate_jumps_by_five_metres_and_the_vehicle_stays(
    hovering: tuple[Simulation, Station],
) -> None:
    sim, _ = hovering
    before_m, believed_m = sim.vehicle.truth.pos_enu_m, sim.autopilot.estimate.pos_enu_m  # type: ignore[union-attr]
    during(sim, fault("ekf_jump"), 3.0)
    jump_m = sim.autopilot.estimate.pos_enu_m - believed_m  # type: ignore[union-attr]
    assert np.linalg.norm(jump_m) == pytest.approx(5.0, abs=0.5)
    assert np.linalg.norm(sim.vehicle.truth.pos_enu_m - before_m) < 0.6


def test_a_drifting_estimate_draws_the_vehicle_with_it_and_ends_at_five_metres(
    hovering: tuple[Simulation, Station],
) -> None:
    sim, _ = hovering
    before_m = sim.vehicle.truth.pos_enu_m
    during(sim, fault("gps_drift"), 4.0)
    assert np.linalg.norm(sim.estimator.jump_enu_m) == pytest.approx(1.2, abs=0.01)
    during(sim, fault("gps_drift"), 20.0)
    moved_m = sim.vehicle.truth.pos_enu_m - before_m
    assert np.hypot(*(moved_m + sim.estimator.jump_enu_m)[:2]) < 0.8


@pytest.mark.parametrize("size_m", [3.0, -3.0])
def test_the_estimate_slides_to_a_barometer_that_jumped_and_back(
    hovering: tuple[Simulation, Station], size_m: float
) -> None:
    """Most of it against its own vertical velocity; an autopilot that holds its height flies it back."""
    sim, _ = hovering

    def error_m() -> float:
        assert sim.autopilot.estimate is not None
        return float(sim.autopilot.estimate.pos_enu_m[2] - sim.vehicle.truth.pos_enu_m[2])

    before_m, before_up_m = error_m(), float(sim.vehicle.truth.pos_enu_m[2])
    jump = faults.build("baro_jump", np.random.default_rng(1), size_m)
    jump.start(sim)
    assert error_m() == before_m
    sim.run(1.0)
    assert abs(sim.autopilot.aiding.height.velocity_error_up_ms) == pytest.approx(0.5, abs=0.1)
    assert (error_m() - before_m) / size_m == pytest.approx(0.72, abs=0.05)
    sim.run(1.0)
    assert (error_m() - before_m) / size_m == pytest.approx(0.98, abs=0.05)
    assert (sim.vehicle.truth.pos_enu_m[2] - before_up_m) / size_m < -0.5
    jump.stop(sim)
    sim.run(8.0)
    assert error_m() == pytest.approx(before_m, abs=0.1)


def test_a_swaying_height_is_about_the_truth_and_ends_with_the_fault(
    hovering: tuple[Simulation, Station],
) -> None:
    sim, _ = hovering
    sways, up_m = fault("estimate_sway"), []
    sim.every_tick.append(lambda s: up_m.append(s.estimator.jump_enu_m[2]))
    during(sim, sways, 6.0)
    assert 0.05 <= max(up_m) <= 0.1
    assert min(up_m) == pytest.approx(-max(up_m), rel=0.01)
    turns = np.count_nonzero(np.diff(np.sign(up_m)) > 0)
    assert 2 <= turns <= 6
    assert not sim.estimator.jump_enu_m.any()


def test_the_pilot_asks_until_the_mode_shows(hovering: tuple[Simulation, Station]) -> None:
    sim, _ = hovering
    taken = fault("pilot_mode")
    sim.router.model.cut = True
    taken.start(sim)
    sim.every_tick.append(taken.on_tick)
    sim.run(2.5)
    sim.router.model.cut = False
    sim.run(2.5)
    assert sim.autopilot.mode in (Mode.LOITER, Mode.BRAKE, Mode.ALT_HOLD)


@pytest.mark.parametrize(
    ("name", "sender"), [("second_vehicle", (2, 1)), ("second_station", (254, 190)), ("gimbal", (1, 154))]
)
def test_a_neighbour_is_heard_by_all_and_changes_nothing(
    hovering: tuple[Simulation, Station], name: str, sender: tuple[int, int]
) -> None:
    sim, end = hovering
    before_m = sim.vehicle.truth.pos_enu_m
    during(sim, fault(name), 3.0)
    spoken = [m for m in messages(end) if (m.get_srcSystem(), m.get_srcComponent()) == sender]
    assert {"HEARTBEAT"} < {m.get_type() for m in spoken}
    assert sim.autopilot.mode is Mode.GUIDED
    assert np.linalg.norm(sim.vehicle.truth.pos_enu_m - before_m) < 0.6
    assert len(sim.router.wires) == 2  # the companion's and the pilot's


def targets(end: Station) -> list[Any]:
    return [m for m in messages(end) if m.get_type() == "POSITION_TARGET_LOCAL_NED"]


def asks_for_targets(sim: Simulation, end: Station) -> None:
    number = mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED
    interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    end.send(mavlink.MAVLink_command_long_message(1, 1, interval, 0, number, 50_000, 0, 0, 0, 0, 0))
    sim.run(0.5)


@pytest.mark.parametrize(
    ("name", "mask", "moved_m"), [("fly_here", 0xDF8, 5.0), ("second_companion", 0xC07, 5.0)]
)
def test_another_commander_flies_the_vehicle_unheard_and_only_the_target_tells(
    hovering: tuple[Simulation, Station], name: str, mask: int, moved_m: float
) -> None:
    sim, end = hovering
    asks_for_targets(sim, end)
    before_m = sim.vehicle.truth.pos_enu_m.copy()
    end.wire.received.clear()
    during(sim, fault(name), 5.0)
    heard = messages(end)
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in heard} <= {(1, 1), (255, 190)}
    assert "COMMAND_INT" not in {m.get_type() for m in heard}
    assert [m.type_mask for m in heard if m.get_type() == "POSITION_TARGET_LOCAL_NED"][-1] == mask
    assert np.linalg.norm(sim.vehicle.truth.pos_enu_m - before_m) > moved_m


def test_targets_are_sent_in_guided_alone(hovering: tuple[Simulation, Station]) -> None:
    sim, end = hovering
    asks_for_targets(sim, end)
    assert targets(end)[-1].type_mask == 0xDF8  # the take-off's height
    sim.autopilot.set_mode(Mode.LOITER)
    sim.run(0.2)
    end.wire.received.clear()
    sim.run(1.0)
    assert targets(end) == []
    sim.autopilot.set_mode(Mode.GUIDED)
    sim.run(0.2)
    (*_, last) = targets(end)
    assert (last.type_mask, last.vx, last.vy, last.vz) == (0xC07, 0.0, 0.0, 0.0)


def test_a_vehicle_on_its_wing_obeys_no_velocity_and_says_what_it_is(
    hovering: tuple[Simulation, Station],
) -> None:
    sim, end = hovering
    wing = fault("wing_flight")
    wing.start(sim)
    sim.run(6.0)
    states = [m.vtol_state for m in messages(end) if m.get_type() == "EXTENDED_SYS_STATE"]
    assert states[-1] == mavlink.MAV_VTOL_STATE_FW
    assert mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW in states
    east, north, up = sim.vehicle.truth.vel_enu_ms
    assert np.hypot(east, north) == pytest.approx(9.6, abs=0.5)
    assert up == pytest.approx(-0.16, abs=0.1)


@pytest.mark.parametrize(
    ("kind", "mav_type", "state"), [(Kind.MULTIROTOR, 2, 3), (Kind.FIXED_WING, 1, 0), (Kind.VTOL, 22, 3)]
)
def test_an_airframe_is_what_its_messages_say(
    hovering: tuple[Simulation, Station], kind: Kind, mav_type: int, state: int
) -> None:
    sim, end = hovering
    sim.autopilot.airframe.kind = kind
    sim.run(5.0)
    speed_ms = float(np.hypot(*sim.vehicle.truth.vel_enu_ms[:2]))
    assert speed_ms == pytest.approx(9.6 if kind is Kind.FIXED_WING else 0.0, abs=0.5)
    newest = {m.get_type(): m for m in messages(end) if m.get_srcComponent() == 1}
    assert (newest["HEARTBEAT"].type, newest["EXTENDED_SYS_STATE"].vtol_state) == (mav_type, state)


@pytest.mark.parametrize("name", ["pilot_mode", "lidar_half", "lidar_rain"])
def test_a_fault_of_what_is_not_there_says_so(name: str) -> None:
    sim = Simulation(scenes.build("landing_site", 1), [MemoryWire()])
    with pytest.raises(ValueError, match="this simulation has no"):
        fault(name).start(sim)


@pytest.mark.parametrize("hovering", [5_000_000], indirect=True)
def test_a_held_up_autopilot_loses_time_that_its_sensors_do_not(
    hovering: tuple[Simulation, Station],
) -> None:
    sim, end = hovering
    boot_ns, now_ns = sim.autopilot.boot_ns, sim.now_ns
    during(sim, fault("autopilot_held_up"), 6.0)
    elapsed_s, shown_s = (sim.now_ns - now_ns) * 1e-9, (sim.autopilot.boot_ns - boot_ns) * 1e-9
    assert elapsed_s == pytest.approx(6.0)
    assert 0.5 * elapsed_s < shown_s < 0.8 * elapsed_s
    heard = [m.time_boot_ms for m in messages(end) if m.get_type() == "GLOBAL_POSITION_INT"]
    assert heard == sorted(heard)
    assert (heard[-1] - heard[0]) * 1e-3 == pytest.approx(shown_s, abs=0.1)
