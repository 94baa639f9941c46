"""Single steps on many small random inputs, with golden values."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.flash.camera import FlashFrame
from slz.flash.ranging import likely_ranges, polynomial_map, polynomial_ranges, range_bound_m
from slz.grid import Box, Grid
from slz.kernels.footprint.certainty import certainty
from slz.kernels.instruments.phase_unwrapping import unwrap_by_quality
from slz.kernels.paper.zone_search import search_zones
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.connected_components import largest_groups
from slz.kernels.raster.distance_transform import greatest_clearance, square_and_clearance
from slz.kernels.raster.region_fill import component
from slz.kernels.raster.zone_views import zone_obstacles
from slz.paper.window_cells import WindowCells
from slz.points.outliers import gap_interval, in_cluster, not_isolated
from slz.radar.accuracy import coherence, height_error_m, phase_error_rad, whole_height_error_m
from slz.radar.interferometer import Interferometer
from slz.zones.boundary_points import without_collinear
from slz.zones.detection import search_components
from slz.zones.polygonise import polygonise
from slz.zones.tile_view import TileView
from tests.unit.slz.flash.waveforms import frame_of, noisy_camera

U8 = NDArray[np.uint8]


def blob(rng: np.random.Generator, rows: int, cols: int, smooth: float, share: float) -> U8:
    """Return cells of ragged ground with holes and crumbs; smoother ones have fewer. No edge cell is set."""
    rough = ndimage.gaussian_filter(rng.normal(size=(rows, cols)), smooth)
    cells = (rough > np.quantile(rough, 1 - share)).astype(np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 0
    return cells


def outlines(seed: int) -> Iterator[Any]:
    """Yield the outlines of shapes, ragged, round and with holes, by several shares of area to lose."""
    rng = np.random.default_rng(seed)
    for k in range(8):
        cells = blob(rng, int(rng.integers(6, 22)), int(rng.integers(6, 26)), 0.5 + 0.2 * k, 0.6)
        yield [polygonise(cells, most_lost) for most_lost in (0.0, 0.02, 0.1)[k % 3 :]]


def zones() -> Iterator[Any]:
    """Yield the components of ragged maps by both searches, their room and their obstacles."""
    rng = np.random.default_rng(22)
    for k in range(12):
        safe = blob(rng, 24, 150, 0.8 + 0.2 * k, 0.55 + 0.02 * k)
        found = list(search_components(safe, Box(3, 27, 5, 155), 3 + k % 3, 12))
        yield found
        yield [without_collinear(zone.boundary_cells) for zone in found]
        bits = packed(np.pad(safe, ((0, 0), (0, 42))))
        square = ndimage.binary_erosion(safe, np.ones((3, 3)), origin=-1).astype(np.uint8)
        seeds = packed(np.pad(square, ((0, 0), (0, 42))))
        whole = (0, 24, 0, bits.shape[1])
        yield search_zones(bits, seeds, np.zeros_like(bits), *whole, 12, 64)
        rest, own = seeds.copy(), bits
        for row, col in np.argwhere(square)[:: max(1, int(square.sum()) // 2)].tolist():
            own = component(bits, row, col)
            side, _, cells = square_and_clearance(own, rest & own, 3)
            yield side, cells, greatest_clearance(own, side, cells[:1])
        holes = packed(np.pad(blob(rng, 24, 150, 0.7, 0.2), ((0, 0), (0, 42))))
        height = rng.normal(0, 1, (24, 64 * bits.shape[1])).astype(np.float32)
        tall = np.pad(height, ((0, 40), (0, 0)), constant_values=np.nan)
        view = TileView.copied(lambda *_, z=tall: z, Box(0, 24, 0, tall.shape[1]), 0, "height_m", "top_m")
        none = np.empty((0, 0), bool), np.empty((0, 6), np.int64), np.empty(0)
        groups, cells, highest, top, ground = zone_obstacles(*view[:5], 0, 0, own, holes & ~own, 12, 3, *none)
        centres = Grid(100.0, 50.0, 0.5, 24, 150).centres(cells)
        yield np.column_stack([centres[highest], top, top - ground]), groups[:, 4:].copy(), centres
        yield largest_groups(holes, 5)


def clouds() -> Iterator[Any]:
    """Yield which returns are kept of clouds, dense and sparse, wide and narrow, with strays."""
    rng = np.random.default_rng(23)
    for k in range(20):
        n, half = 300 + 20 * k, (4.0, 9.0, 30.0, 900.0)[k % 4]
        points = np.column_stack([rng.uniform(-half, half, (n, 2)), rng.normal(0, 0.05, n)])
        points[: n // 3] = rng.normal((1.0, -2.0, 0.4), (0.5, 0.5, 0.3), (n // 3, 3))
        points[-12:, 2] += rng.uniform(-9.0, 14.0, 12)
        sensor = np.array([0.3, -0.7, 12.0 + k]) if k % 5 else np.full(3, np.nan)
        keep = not_isolated(points, sensor, 0.1 + 0.05 * (k % 3))
        yield keep
        yield gap_interval(points[:, 2], 0.5 + 0.4 * (k % 4), 0.004 * (k % 6))
        yield in_cluster(points[-40:], 2.0 + k, 3)
        returns, grid = WindowCells(), Grid(-5.0, -6.0, 0.25 + 0.05 * k, 30, 90)
        returns.read(points, sensor, 25.0 + 3 * k, grid)
        yield returns.low_m, returns.high_m, returns.n, returns.n_outside, returns.box
        returns.keep_heights(10 + 15 * k, 0.9)
        sums, unit_m, count_bits, used = returns.sums()
        yield returns.kept(), returns.first_outside(), returns.low_m, returns.high_m
        yield (sums & np.uint64((1 << count_bits) - 1)), (sums >> np.uint64(count_bits)) * unit_m, used


def pulses() -> Iterator[Any]:
    """Yield what both estimators find in waveforms near the buffer's ends, weak, clipped, double or none."""
    rng = np.random.default_rng(24)
    camera = noisy_camera(0.06, height=1500.0, rows=8, cols=20, saturated_counts=10_500)
    shape = camera.rows, camera.cols
    peak = rng.uniform(-1.5, camera.n_samples + 0.5, shape)
    height = rng.choice([60.0, 200.0, 900.0, 2400.0, 3300.0, 9000.0], shape)
    frame, _ = frame_of(camera, peak, height, 0.06, seed=3)
    other, _ = frame_of(camera, np.roll(peak, 3, axis=1), height[::-1], 0.03, seed=3)
    samples = frame.samples.copy()
    samples[5:] = np.maximum(samples[5:], other.samples[5:])  # two pulses, and sometimes two markers
    samples[4, 3:6] = 0
    counter = frame.counter.copy()
    counter[3, ::4] = camera.gate_counter
    frame = FlashFrame(samples, counter)
    yield likely_ranges(frame, camera)
    yield polynomial_ranges(frame, camera)
    yield [polynomial_map(count, degree) for count, degree in ((9, 3), (19, 6))]
    yield [range_bound_m(camera, share) for share in (0.05, 0.2)]


def formulas() -> Iterator[Any]:
    """Yield the certainty of cells and the radar's accuracy over what they depend on; turns put right."""
    rng = np.random.default_rng(25)
    for _ in range(60):
        slope, sigma, noise = rng.uniform(0, 12), rng.uniform(0, 2), rng.uniform(0, 0.06)
        relief, seen = rng.uniform(0, 0.35), rng.uniform(0, 1)
        yield certainty(slope, sigma, relief, rng.uniform(0.5, 1) * relief, noise, seen, 8.0, 0.2, 9)
    look = np.radians(np.linspace(5.0, 75.0, 12))
    for radar in (
        Interferometer(),
        Interferometer(13e9, 0.7, 40.0, 1.5, 0.8, 9, both_transmit=False),
        Interferometer(35e9, 0.3, 110.0, 0.2),
    ):
        for more in ({}, {"roughness_m": 0.02, "snr_db": 4.0}):
            yield coherence(radar, 75.0, look, **more), height_error_m(radar, 120.0, look, **more)
        yield phase_error_rad(np.array([0.0, 0.2, 0.9, 1.0]), radar.looks)
        for roll in (0.0, -0.06):
            phase = radar.phase_rad(75.0 / np.cos(look), look, roll)
            yield phase, radar.look_rad(75.0 / np.cos(look), phase, roll)
            yield radar.height_m(80.0, 75.0 / np.cos(look), phase, roll)
            yield radar.metres_per_radian(75.0 / np.cos(look), look, roll)
    yield whole_height_error_m(0.03, 0.04, 0.05, 0.06)
    for k in range(3):
        ramp = 0.4 * np.arange(14)[:, np.newaxis] + 0.3 * np.arange(17) + rng.normal(0, 0.3, (14, 17))
        quality = rng.uniform(0, 1, ramp.shape)
        yield unwrap_by_quality((ramp + np.pi) % (2 * np.pi) - np.pi, quality, 0.1 + 0.15 * k)
