"""Budgets of the search for wires: `taskset -c 1 pytest -m bench -s tests/bench/test_wires.py`.

Processor times of windows of 20,000 returns over ground and a wire, over ground alone, and over a forest.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz.air.seen_air import SeenAir
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.frame_processing import process_frame, sensor_points
from slz.radar.dem import fuse, observe
from slz.radar.interferometer import Interferometer
from slz.wires.wire_detector import WireDetector
from tests.unit.slz.flash.pit import Pit
from tests.unit.slz.radar.site import GRID, Site
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


# Budgets of the flash LiDAR and the radar: processor time on one core.


FRAME_MS, SITE_S = 20.0, 2.0


def median_s(work: Callable[[], object], times: int) -> float:
    """Return the median processor time of a computation in this thread."""
    taken = []
    for _ in range(times):
        started = time.thread_time()
        work()
        taken.append(time.thread_time() - started)
    return float(np.median(taken))


@pytest.mark.parametrize("estimator", ["likely", "polynomial"])
def test_a_flash_frame_of_128_by_128_takes_at_most_20_ms(estimator: str) -> None:
    raw, _, _ = Pit(1).look(0.0, 0.0)
    frame, camera = FlashFrame(raw.samples, raw.counter), FlashCamera()
    ms = 1e3 * median_s(lambda: sensor_points(process_frame(frame, camera, estimator), camera), 40)  # type: ignore[arg-type]
    print(f"\n{estimator}: {ms:.1f} ms from waveforms to points")
    assert ms <= FRAME_MS


def test_the_landing_site_of_100_m_at_half_a_metre_takes_at_most_2_s() -> None:
    site, radar = Site(1), Interferometer()
    seconds = median_s(lambda: fuse([observe(lines, radar, GRID) for lines in site.lines]), 5)
    print(f"\nfour observations and fusing: {seconds:.2f} s")
    assert seconds <= SITE_S
