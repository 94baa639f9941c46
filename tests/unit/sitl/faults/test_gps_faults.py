"""Faults of GPS and compass: what the receiver measures, and how far the estimate follows."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import faults, scenes
from sitl.autopilot import parameters
from sitl.autopilot.aiding.ekf2_aiding import Ekf2Aiding
from sitl.autopilot.estimator import EstimateErrors
from sitl.autopilot.modes import Mode
from sitl.autopilot.position_aiding import AIDED, TIMED_OUT, PositionAiding
from sitl.simulation import Simulation
from sitl.vehicle.rigid_body import to_euler
from sitl.wire.wire import MemoryWire

F64 = NDArray[np.float64]
HEIGHT_M = 8.0


@pytest.fixture
def hovering() -> Simulation:
    """Return a vehicle in GUIDED at eight metres, whose estimate is true."""
    sim = Simulation(
        scenes.build("landing_site", 1),
        [MemoryWire()],
        pilot_height_m=HEIGHT_M,
        ready_after_s=0.1,
        tick_ns=10_000_000,
        wind_ms=0.0,
        errors=EstimateErrors.none(),
        parameters={"WPNAV_SPEED_UP": 500.0},
    )
    sim.run(12.0)
    assert sim.autopilot.mode is Mode.GUIDED
    return sim


def begun(sim: Simulation, name: str, size: float | None = None, seed: int = 1) -> faults.Fault:
    fault = faults.build(name, np.random.default_rng(seed), size)
    fault.start(sim)
    sim.every_tick.append(fault.on_tick)
    return fault


def ended(sim: Simulation, fault: faults.Fault) -> None:
    sim.every_tick.remove(fault.on_tick)
    fault.stop(sim)


def error_m(sim: Simulation) -> float:
    """Return the horizontal error of the estimate, before the vehicle's next tick moves on."""
    assert sim.autopilot.estimate is not None
    return float(np.hypot(*(sim.autopilot.estimate.pos_enu_m - sim.vehicle.truth.pos_enu_m)[:2]))


def recorded(sim: Simulation, seconds: float, what: Callable[[Simulation], float]) -> F64:
    values: list[float] = []

    def note(s: Simulation) -> None:
        values.append(what(s))

    sim.every_tick.append(note)
    sim.run(seconds)
    sim.every_tick.remove(note)
    return np.array(values)


def gps_error_m(sim: Simulation) -> float:
    return float(np.hypot(*sim.autopilot.aiding.gnss.error_enu_m[:2]))


def test_denied_gps_does_not_return(hovering: Simulation) -> None:
    fault = begun(hovering, "gps_denied")
    hovering.run(8.0)
    ended(hovering, fault)
    hovering.run(1.0)
    assert hovering.autopilot.aiding.fix_type == mavlink.GPS_FIX_TYPE_NO_FIX
    assert hovering.autopilot.aiding.flags == TIMED_OUT
    assert hovering.autopilot.mode is Mode.LAND


def test_a_fault_begins_below_its_height_in_the_descent_only(hovering: Simulation) -> None:
    (hook,) = faults.read("gps_denied@5", 1)
    hovering.every_tick.append(hook)
    hovering.run(2.0)
    assert not hook.has_begun
    hovering.autopilot.set_mode(Mode.LAND)
    heights = recorded(hovering, 3.0, lambda s: float(s.autopilot.aiding.gps))
    x, y, z = (float(v) for v in hovering.vehicle.truth.pos_enu_m)
    for _ in range(8):
        if hook.has_begun:
            break
        hovering.run(1.0)
        x, y, z = (float(v) for v in hovering.vehicle.truth.pos_enu_m)
    assert heights[0] == 1.0
    assert hook.has_begun
    assert 3.5 < z - hovering.scene.world.height_below_m(x, y, z) < 5.0
    assert not hovering.autopilot.aiding.gps


def test_a_fault_at_a_height_does_not_begin_in_the_climb() -> None:
    sim = Simulation(
        scenes.build("landing_site", 1), [MemoryWire()], pilot_height_m=HEIGHT_M, ready_after_s=0.1
    )
    (hook,) = faults.read("gps_denied@5", 1)
    sim.every_tick.append(hook)
    sim.run(10.0)
    assert not hook.has_begun


@pytest.mark.parametrize(
    "text", ["gps_denied", "nothing@5", "gps_denied=1@5", "link_loss@5", "yaw_drift=x@5", "gps_denied@-1"]
)
def test_a_fault_that_cannot_begin_at_a_height_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="fault "):
        faults.read(text, 1)


def test_several_faults_have_their_sizes_and_heights() -> None:
    hooks = faults.read("gps_slow_drift=0.5@8,yaw_drift@6", 1)
    assert [hook.height_m for hook in hooks] == [8.0, 6.0]
    assert faults.read("none", 1) == []


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_multipath_wanders_by_metres_with_a_good_fix_and_the_filter_follows_in_part(
    hovering: Simulation, seed: int
) -> None:
    fault = begun(hovering, "gps_multipath", seed=seed)
    both = recorded(hovering, 40.0, lambda s: gps_error_m(s) + 1j * error_m(s))  # type: ignore[return-value]
    gps, estimate = np.real(both), np.imag(both)
    assert 0.8 < gps.max() <= 3.0
    assert 0.3 < estimate.max() < gps.max()
    assert np.abs(np.diff(gps)).max() > 0.08  # a step within a tick
    assert np.abs(np.diff(estimate)).max() < 0.08
    assert hovering.autopilot.aiding.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
    assert hovering.autopilot.aiding.flags == AIDED
    ended(hovering, fault)
    hovering.run(12.0)
    assert error_m(hovering) < 0.05


@pytest.mark.parametrize("rate_ms", [0.1, 1.0])
def test_a_slow_drift_carries_the_estimate_off_without_a_sign(hovering: Simulation, rate_ms: float) -> None:
    place_m = hovering.vehicle.truth.pos_enu_m
    fault = begun(hovering, "gps_slow_drift", rate_ms)
    ratios = recorded(hovering, 15.0, lambda s: s.autopilot.aiding.position_test_ratio)
    assert error_m(hovering) == pytest.approx(15.0 * rate_ms, rel=0.05)
    assert np.hypot(*(hovering.vehicle.truth.pos_enu_m - place_m)[:2]) > 0.8 * 15.0 * rate_ms
    assert ratios.max() < 0.1
    assert hovering.autopilot.aiding.flags == AIDED
    ended(hovering, fault)
    hovering.run(3.0)
    assert error_m(hovering) == pytest.approx(15.0 * rate_ms, rel=0.05)


def test_a_spoofer_is_in_line_at_first_and_then_carries_off(hovering: Simulation) -> None:
    begun(hovering, "gps_spoof", 1.0)
    assert recorded(hovering, 3.0, error_m).max() < 0.05
    ratios = recorded(hovering, 15.0, lambda s: s.autopilot.aiding.position_test_ratio)
    assert error_m(hovering) == pytest.approx(12.5, abs=0.5)
    assert ratios.max() < 0.1


def test_the_end_of_spoofing_far_away_is_rejected_and_then_jumped_to(hovering: Simulation) -> None:
    fault = begun(hovering, "gps_spoof", 1.0)
    hovering.run(15.0)
    ended(hovering, fault)
    hovering.run(8.0)
    assert error_m(hovering) > 8.0
    hovering.run(4.0)
    assert error_m(hovering) < 0.1


def test_a_takeover_is_rejected_for_ten_seconds_and_then_jumped_to(hovering: Simulation) -> None:
    begun(hovering, "gps_takeover", 30.0)
    hovering.run(9.0)
    assert error_m(hovering) < 0.1
    assert hovering.autopilot.aiding.position_test_ratio > 5.0
    assert hovering.autopilot.aiding.flags == AIDED | mavlink.EKF_GPS_GLITCHING
    before_m = hovering.vehicle.truth.pos_enu_m
    hovering.run(2.0)
    assert error_m(hovering) == pytest.approx(30.0, abs=0.2)
    assert np.hypot(*(hovering.vehicle.truth.pos_enu_m - before_m)[:2]) < 0.5
    assert not hovering.autopilot.failsafes.any_triggered


def test_the_receiver_reports_its_own_position_not_the_estimate(hovering: Simulation) -> None:
    begun(hovering, "gps_takeover", 30.0)
    hovering.run(5.0)
    sent: list[object] = []
    hovering.autopilot.add_link(9)
    hovering.autopilot.telemetry.send_once(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 9)
    sent = [m for _, m in hovering.autopilot.take_outgoing(hovering.now_ns) if m.get_type() == "GPS_RAW_INT"]
    place = hovering.autopilot.enu_m(sent[-1].lat / 1e7, sent[-1].lon / 1e7, sent[-1].alt / 1000)  # type: ignore[attr-defined]
    assert np.hypot(*(place - hovering.vehicle.truth.pos_enu_m)[:2]) == pytest.approx(30.0, abs=0.3)


@pytest.mark.parametrize("rate_deg_s", [1.0, -2.0])
def test_the_heading_drifts_to_twenty_degrees_and_stays(hovering: Simulation, rate_deg_s: float) -> None:
    begun(hovering, "yaw_drift", rate_deg_s)
    hovering.run(10.0)
    assert heading_error_deg(hovering) == pytest.approx(9.0 * rate_deg_s, abs=2.0)
    hovering.run(20.0)
    assert heading_error_deg(hovering) == pytest.approx(math.copysign(20.0, rate_deg_s), abs=0.5)


def heading_error_deg(sim: Simulation) -> float:
    assert sim.autopilot.estimate is not None
    estimate, truth = (to_euler(s.quat_wxyz)[2] for s in (sim.autopilot.estimate, sim.vehicle.truth))
    return math.degrees(math.remainder(estimate - truth, 2 * math.pi))


@pytest.mark.parametrize(
    "name", ["gps_slow_drift", "gps_spoof", "gps_takeover", "gps_multipath", "gps_drift"]
)
def test_external_navigation_in_use_is_free_of_gps(name: str) -> None:
    sim = Simulation(
        scenes.build("landing_site", 1), [MemoryWire()], parameters={"EK3_SRC1_POSXY": 6.0}, ready_after_s=0.1
    )
    sim.run(0.5)
    begun(sim, name)
    sim.run(4.0)
    assert sim.autopilot.estimate is not None
    assert error_m(sim) < 0.8  # dead reckoning and its own errors


def test_a_size_is_refused_where_there_is_none() -> None:
    with pytest.raises(ValueError, match="takes no size"):
        faults.build("gps_loss", np.random.default_rng(1), 1.0)


@pytest.mark.parametrize("ekf2", [False, True])
def test_a_jump_of_gps_is_reported_as_a_glitch_while_it_is_rejected(ekf2: bool) -> None:
    aiding = Ekf2Aiding(parameters.with_defaults({"EKF2_EN": 1.0})) if ekf2 else PositionAiding()
    flag = mavlink.ESTIMATOR_GPS_GLITCH if ekf2 else mavlink.EKF_GPS_GLITCHING
    flagged = []
    for tick in range(300):
        aiding.gnss.error_enu_m = np.array([8.0, 0.0, 0.0]) if 20 <= tick < 80 else np.zeros(3)
        aiding.update(0.1)
        flagged.append(bool(aiding.flags & flag))
    first, last = flagged.index(True), len(flagged) - flagged[::-1].index(True)
    assert (first, last) == pytest.approx((20, 80) if ekf2 else (30, 180), abs=3)


def test_of_two_receivers_the_first_dies_and_the_filter_does_not_notice(hovering: Simulation) -> None:
    begun(hovering, "gps_first_lost")
    autopilot = hovering.autopilot
    autopilot.add_link(9)

    def fixes() -> dict[str, int]:
        for number in (mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, mavlink.MAVLINK_MSG_ID_GPS2_RAW):
            autopilot.telemetry.send_once(number, 9)
        sent = [m for _, m in autopilot.take_outgoing(hovering.now_ns)]
        return {m.get_type(): m.fix_type for m in sent if m.get_type().startswith("GPS")}

    hovering.run(1.0)
    assert set(fixes().values()) == {mavlink.GPS_FIX_TYPE_RTK_FLOAT}
    hovering.run(20.0)
    assert fixes() == {"GPS_RAW_INT": 0, "GPS2_RAW": mavlink.GPS_FIX_TYPE_RTK_FLOAT}
    assert autopilot.aiding.flags == AIDED
