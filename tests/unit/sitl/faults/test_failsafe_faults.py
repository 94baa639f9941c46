"""The pilot's stick, and faults that trigger a failsafe of the autopilot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sitl import faults, scenes
from sitl.autopilot.modes import Mode
from sitl.simulation import Simulation
from sitl.wire.wire import MemoryWire
from tests.unit.sitl.faults.test_autopilot_faults import during, messages
from tests.unit.sitl.wire.test_wire import COMPANION, Station

HEIGHT_M = 6.0
FAR = {"FENCE_ALT_MAX": 100.0, "FENCE_RADIUS": 300.0}


@pytest.fixture
def hovering() -> Simulation:
    """Return a vehicle in GUIDED, six metres up and some way from home."""
    sim = Simulation(
        scenes.build("landing_site", 1),
        [MemoryWire()],
        pilot_height_m=HEIGHT_M,
        ready_after_s=0.1,
        tick_ns=10_000_000,
        wind_ms=0.0,
        parameters={"WPNAV_SPEED_UP": 500.0},
    )
    sim.run(9.0)
    assert sim.autopilot.mode is Mode.GUIDED
    home_enu_m = sim.autopilot.navigator.home_enu_m
    sim.autopilot.navigator.guided.position_enu_m = home_enu_m + np.array([4.0, 3.0, HEIGHT_M])
    return sim.run(4.0)


def begun(sim: Simulation, name: str, seed: int, seconds: float) -> faults.Fault:
    fault = faults.build(name, np.random.default_rng(seed))
    fault.start(sim)
    sim.run(seconds)
    return fault


@pytest.mark.parametrize("name", ["battery_failsafe", "radio_failsafe", "fence_breach"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_loss_makes_the_autopilot_return_and_stays_so_after_its_end(
    hovering: Simulation, name: str, seed: int
) -> None:
    fault = begun(hovering, name, seed, 3.0)
    assert hovering.autopilot.mode is Mode.RTL
    assert hovering.autopilot.failsafes.in_charge
    fault.stop(hovering)
    hovering.run(3.0)
    assert hovering.autopilot.mode is Mode.RTL
    assert hovering.autopilot.failsafes.in_charge


def test_ceiling_and_circle_are_both_drawn(hovering: Simulation) -> None:
    drawn = set()
    for seed in range(8):
        hovering.autopilot.parameters.update(FAR)
        faults.build("fence_breach", np.random.default_rng(seed)).start(hovering)
        drawn |= {name for name, far_m in FAR.items() if hovering.autopilot.parameters[name] < far_m}
    assert drawn == set(FAR)


def test_lost_gps_ends_in_a_landing_that_its_return_does_not_end(hovering: Simulation) -> None:
    fault = begun(hovering, "gps_loss", 1, 9.0)
    assert hovering.autopilot.mode is Mode.LAND
    fault.stop(hovering)
    hovering.run(4.0)
    assert not hovering.autopilot.failsafes.any_triggered
    assert hovering.autopilot.mode is Mode.LAND
    assert hovering.autopilot.failsafes.in_charge


@pytest.mark.parametrize("seed", range(4))
def test_a_stick_moves_a_landing_and_is_let_go(hovering: Simulation, seed: int) -> None:
    hovering.autopilot.set_mode(Mode.LAND)
    hovering.run(1.0)
    before_m = hovering.vehicle.truth.pos_enu_m
    fault = begun(hovering, "pilot_stick", seed, 3.0)
    assert np.linalg.norm((hovering.vehicle.truth.pos_enu_m - before_m)[:2]) > 0.5
    assert hovering.autopilot.navigator.repositioned
    fault.stop(hovering)
    hovering.run(0.5)
    assert not hovering.autopilot.receiver.sticks(hovering.now_ns).steering


def test_a_stick_in_guided_moves_nothing(hovering: Simulation) -> None:
    before_m = hovering.vehicle.truth.pos_enu_m
    begun(hovering, "pilot_stick", 1, 3.0)
    assert np.linalg.norm(hovering.vehicle.truth.pos_enu_m - before_m) < 0.6


def test_what_is_drawn_is_the_same_for_the_same_seed(hovering: Simulation) -> None:
    pulses = []
    for seed in (3, 3, 4):
        fault = begun(hovering, "pilot_stick", seed, 0.01)
        pulses.append(tuple(hovering.autopilot.receiver.transmitter))
        fault.stop(hovering)
    assert pulses[0] == pulses[1] != pulses[2]


# Faults of the autopilot's wind messages.


def winds(name: str) -> tuple[list[Any], list[Any]]:
    """Return the WIND messages while a fault lasts, and those after it."""
    end = Station(1, COMPANION)
    sim = Simulation(
        scenes.build("landing_site", 1), [end.wire], pilot_height_m=5.0, ready_after_s=0.1, tick_ns=10_000_000
    )
    sim.run(10.0)
    end.wire.received.clear()
    during(sim, faults.build(name, np.random.default_rng(1)), 8.0)
    heard = [m for m in messages(end) if m.get_type() == "WIND"]
    end.wire.received.clear()
    sim.run(3.0)
    return heard, [m for m in messages(end) if m.get_type() == "WIND"]


def test_missing_wind_is_silent_and_comes_back() -> None:
    heard, after = winds("wind_missing")
    assert heard == []
    assert after


def test_absurd_wind_is_not_a_number_endless_negative_or_too_fast() -> None:
    heard, after = winds("wind_absurd")
    assert len(heard) >= 6
    assert all(
        not math.isfinite(m.speed + m.direction) or not 0 <= m.speed <= 75 or m.direction > 1e9 for m in heard
    )
    assert all(m.speed == pytest.approx(3.0, abs=4.0) and abs(m.direction) <= 180 for m in after)
