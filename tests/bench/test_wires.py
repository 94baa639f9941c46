"""Budgets of the search for wires: `taskset -c 1 pytest -m bench -s tests/bench/test_wires.py`.

Processor times of windows of 20,000 returns over ground and a wire, over ground alone, and over a forest.
"""

from __future__ import annotations

import time

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.air.seen_air import SeenAir
from slz.wires.wire_detector import WireDetector
from tests.unit.slz.wires.worlds import Body, Catenary, approach, box, ground, seen, wire

pytestmark = pytest.mark.bench

Floats = NDArray[np.float64]
LINE = Catenary(np.array([-25.0, 10.0, 9.0]), np.array([25.0, 14.0, 10.0]), 0.8)
WAY = approach([0.0, -20.0, 30.0], [0.0, 5.0, 14.0], 40)
GROUND_PER_M2 = 20_000 / 60.0**2
MOST_MS, MOST_CLUTTERED_MS, MOST_NS = 3.0, 8.0, 30.0


def times_ms(bodies: list[Body]) -> Floats:
    """Return the processor time of each window after the first five."""
    parameters, rng, out = params.load("quadcopter", []), np.random.default_rng(1), []
    air = SeenAir(parameters)
    detector = WireDetector(parameters, air)
    for k, sensor in enumerate(WAY):
        points = seen(bodies, sensor, rng)
        rays = np.zeros(len(points), np.uint16), sensor[np.newaxis].copy()
        air.add(points, *rays, 0.0)
        start = time.thread_time()
        detector.update(points, sensor, float(k), k * 1_000_000_000, rays)
        out.append((time.thread_time() - start) * 1e3)
    return np.array(out[5:])


@pytest.mark.parametrize(
    ("name", "bodies", "most_ms"),
    [
        ("ground", [ground(GROUND_PER_M2)], MOST_MS),
        ("ground and a wire", [ground(GROUND_PER_M2), wire(LINE, 1.0)], MOST_MS),
        ("forest", [ground(GROUND_PER_M2 / 2), box([-30, -30, 4], [30, 30, 14], 10_000)], MOST_CLUTTERED_MS),
    ],
    ids=["ground", "wire", "forest"],
)
def test_a_window_of_20_000_returns(name: str, bodies: list[Body], most_ms: float) -> None:
    median_ms = float(np.median(times_ms(bodies)))
    print(f"| wires, window of 20,000 returns, {name} | {median_ms:.2f} | {most_ms:g} ms |")
    assert median_ms <= most_ms


def test_a_return_of_the_ground() -> None:
    few, many = (np.median(times_ms([ground(GROUND_PER_M2 * k)])) for k in (1, 3))
    ns = float(many - few) * 1e6 / 40_000
    print(f"| wires, a return of the ground | {ns:.0f} | {MOST_NS:g} ns |")
    assert ns <= MOST_NS
