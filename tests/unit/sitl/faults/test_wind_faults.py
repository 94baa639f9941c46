"""Faults of the autopilot's wind messages."""

import math
from typing import Any

import numpy as np
import pytest

from sitl import faults, scenes
from sitl.simulation import Simulation
from tests.unit.sitl.faults.test_autopilot_faults import during, messages
from tests.unit.sitl.wire.test_wire import COMPANION, Station


def winds(name: str) -> tuple[list[Any], list[Any]]:
    """Return the WIND messages while a fault lasts, and those after it."""
    end = Station(1, COMPANION)
    sim = Simulation(
        scenes.build("landing_site", 1), [end.wire], pilot_height_m=5.0, ready_after_s=0.1, tick_ns=5_000_000
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
