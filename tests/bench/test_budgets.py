"""Budgets of time and memory: `taskset -c 1 pytest -m bench -s tests/bench/test_budgets.py`.

Times are processor times, and the best of several runs for single figures, so that other programs matter
little. The allocator keeps memory, as in flight. Every figure is printed beside its budget.
"""

from __future__ import annotations

import gc
import struct
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle, islice

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from companion.desk.benchmark import _rss_mb
from companion.flight.fusion.georeference import Georeferencer
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.sensors.decoders.livox_decoder import LivoxDecoder
from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from companion.flight.sensors.returns import Returns
from companion.runtime.process_tuning import keep_memory
from slz import LocalFrame, Pipeline, Window
from slz.warm_up import warm_up
from tests.unit.companion.flight.sensors.velodyne_packets import velodyne_packet

pytestmark = pytest.mark.bench

FRAME = LocalFrame(45.0, -75.0, 0.0)
WINDOWS = 600
N_VELODYNE = 750 * 384


@dataclass(frozen=True)
class Budget:
    """What is measured, in what unit, and the most it may be."""

    name: str
    unit: str
    most: float

    def hold(self, value: float) -> None:
        print(f"| {self.name} | {value:.4g} | {self.most:g} {self.unit} |")
        assert value <= self.most, self.name


P99 = Budget("window, 99th percentile over median", "", 3)
WORST = Budget("window, greatest over median", "", 6)
GROWTH = Budget("memory per window over the last half", "MB", 0.01)
LARGER_TIME = Budget("time in a zone 25 times larger", "", 1.1)
LARGER_MEMORY = Budget("memory in a zone 25 times larger", "", 1.2)
READY = Budget("start to ready with a filled cache, warm-up", "s", 3)
FUSION = Budget("fusion of one point", "ns", 15)
LIVOX = Budget("decoding of one Livox point", "ns", 25)
VELODYNE = Budget("decoding of one Velodyne point", "ns", 25)


@pytest.fixture(autouse=True, scope="module")
def _allocator_of_a_flight() -> None:
    keep_memory()


def parameters(zone_m: float, mode: str = "source") -> params.Parameters:
    own = ["cell_m=0.5", f"zone_m={zone_m}", "min_square_m=3", "min_boundary_points=100"]
    return params.load("quadcopter", [f"mode={mode}", "safe_slope_deg=5", *own])


def flight(count: int, points: int = 20_000) -> list[Window]:
    """Windows along a circle over rolling ground with boxes, 50 m about the vehicle."""
    rng = np.random.default_rng(0)
    windows = []
    for second in range(count):
        turn = 2 * np.pi * second / count
        way, angle = 50 * np.sqrt(rng.random(points)), rng.uniform(0, 2 * np.pi, points)
        xy = np.column_stack([way * np.cos(angle), way * np.sin(angle)]) + 60 * np.array(
            [np.cos(turn), np.sin(turn)]
        )
        z = np.sin(xy[:, 0] / 20) + rng.normal(0, 0.01, points)
        z[(np.floor(xy / 6).astype(int) % 5 == 0).all(axis=1)] += 4
        stamps = (second * 10**9 + np.arange(points) * (10**9 // points)).astype(np.int64)
        place = np.column_stack([xy, z])
        windows.append(Window(place, stamps, np.full(3, np.nan), FRAME, int(stamps[0]), int(stamps[-1])))
    return windows


def flown(zone_m: float, windows: list[Window]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ms and the memory after each window; garbage is collected as in flight."""
    gc.collect()
    gc.freeze()
    pipe = Pipeline(parameters(zone_m), (0.0, 0.0), follow=False)
    ms, memory = [], []
    for window in windows:
        start = time.thread_time()
        pipe.process(window)
        ms.append((time.thread_time() - start) * 1e3)
        memory.append(_rss_mb())
    gc.unfreeze()
    return np.array(ms), np.array(memory)


def best(task: Callable[[], int], runs: int = 9) -> float:
    """Return the least ns that a task took for each of the things that it did."""
    least = np.inf
    for _ in range(runs):
        start = time.thread_time()
        done = task()
        least = min(least, (time.thread_time() - start) * 1e9 / done)
    return float(least)


def test_ready_soon() -> None:
    for mode in ("source", "default"):
        warm_up(parameters(500.0, mode))  # the cache is filled
        start = time.perf_counter()
        warm_up(parameters(500.0, mode))
        READY.hold(time.perf_counter() - start)


def test_windows_take_about_as_long_as_each_other_and_no_more_memory() -> None:
    warm_up(parameters(500.0))
    ms, memory = flown(500.0, list(islice(cycle(flight(60)), WINDOWS)))
    median = float(np.median(ms[60:]))
    P99.hold(float(np.percentile(ms[60:], 99)) / median)
    WORST.hold(float(ms[60:].max()) / median)
    half = memory[WINDOWS // 2 :]
    GROWTH.hold(float(np.polyfit(np.arange(len(half)), half, 1)[0]))


def test_the_size_of_the_map_does_not_matter() -> None:
    warm_up(parameters(500.0))
    windows = flight(60)
    flown(500.0, windows)
    small, large = zip(*((flown(500.0, windows), flown(2500.0, windows)) for _ in range(5)), strict=True)
    time_of = [np.minimum.reduce([ms for ms, _ in runs]) for runs in (small, large)]
    memory_of = [max(float(memory[-1]) for _, memory in runs) for runs in (small, large)]
    LARGER_TIME.hold(float(np.median(time_of[1] / time_of[0])))
    LARGER_MEMORY.hold(memory_of[1] / memory_of[0])


def test_fusion() -> None:
    p = params.load("quadcopter", [])
    history, n = PoseHistory(p), 200_000
    for k in range(60):
        stamp = k * 20_000_000
        history.add_attitude(stamp, (1.0, 0.01 * np.sin(k), 0.0, 0.0), (0, 0, 0))
        history.add_position(stamp, 45.0 + 1e-7 * k, -75.0, 30.0, (0.5, 0.0, 0.0))
    rng = np.random.default_rng(0)
    xyz = rng.uniform(2, 20, (n, 3)).astype(np.float32)
    some = np.ones(n, np.uint8)
    returns = Returns(xyz, np.linspace(0, 10**9, n).astype(np.int64), some, some, some, some)
    place = Georeferencer(p)

    def task() -> int:
        scan = place.georeference(returns, history)
        assert scan is not None
        return len(scan.stamp_ns)

    FUSION.hold(best(task))


def test_livox_decoding() -> None:
    rng = np.random.default_rng(0)
    cartesian = np.dtype([("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")])
    packets = []
    for k in range(2000):
        points = np.zeros(96, cartesian)
        points["xyz"] = rng.integers(1000, 20_000, (96, 3))
        body = struct.pack("<Q", k * 480_000) + points.tobytes()
        size = 28 + len(body)
        head = struct.pack("<BHHHHBBB12s", 0, size, 4750, 96, k & 0xFFFF, 0, 1, 0, b"")
        packets.append(head + struct.pack("<I", zlib.crc32(body)) + body)

    LIVOX.hold(best(lambda: len(LivoxDecoder().decode(packets))))


def test_velodyne_decoding() -> None:
    packets = [
        velodyne_packet(
            lambda _block, place: (5000 + place, 77), azimuth=480 * k % 36_000, stamp_us=1_327 * k
        )
        for k in range(750)
    ]
    assert len(VelodyneDecoder().decode(packets)) == N_VELODYNE
    VELODYNE.hold(best(lambda: len(VelodyneDecoder().decode(packets))))
