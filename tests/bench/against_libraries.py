"""Processor times of own algorithms and of libraries on one thread (docs/adr/0024-own-algorithms.md).

python -m tests.bench.against_libraries [--repeat 9] [--only voxels]

Input is the same, though own kernels take bitmaps and libraries one byte per cell. Each computation runs once
before it is timed. OpenCV, scikit-image and Open3D are no dependencies; what is not installed is left out.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
import shapely
from scipy import ndimage
from scipy.spatial import cKDTree

from slz.flash.frame_processing import median_of_neighbours
from slz.kernels.instruments.phase_unwrapping import unwrap_by_quality
from slz.kernels.polygons.boundary_tracing import trace_boundary
from slz.kernels.raster.bitmap import packed, unpacked
from slz.kernels.raster.connected_components import components
from slz.kernels.raster.distance_transform import square_and_clearance
from slz.kernels.raster.morphology import closed, dilated, eroded
from slz.points.outliers import LEAST_SUPPORT, not_isolated
from slz.zones.polygonise import polygonise
from tests.oracle.test_outline import noisy

Work = Callable[[], object]
Case = tuple[str, Work]
SIDE, RADIUS, SQUARE, CELL_M, VOXEL_M = 1000, 4, 10, 0.2, 0.3
EIGHT, BLOCK = np.ones((3, 3), np.uint8), np.ones((2 * RADIUS + 1, 2 * RADIUS + 1), np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeat", type=int, default=9)
    parser.add_argument("--only", choices=CASES, default=None)
    asked = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"  # read when Open3D is imported
    for name in [asked.only] if asked.only else CASES:
        for who, work in CASES[name]():
            print(f"{name:14s} {who:50s} {1e3 * median_s(work, asked.repeat):10.3f} ms", flush=True)


def median_s(work: Work, repeat: int) -> float:
    work()
    taken = []
    for _ in range(repeat):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return float(np.median(taken))


def library(name: str) -> Any:
    """Return an optional module, bound to one thread, or None where it is not installed."""
    try:
        module = import_module(name)
    except ImportError:
        return None
    if name == "cv2":
        module.setNumThreads(1)
    return module


def safe_map() -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return a map of safe cells, 55 % of them, with ragged zones; none on the margin."""
    field = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(SIDE, SIDE)), 6.0)
    cells = (field > np.quantile(field, 0.45)).astype(np.uint8)
    cells[np.random.default_rng(2).random(cells.shape) < 0.001] = 0
    cells[[0, -1]], cells[:, [0, -1]] = 0, 0
    return cells


def largest_zone() -> np.ndarray[Any, np.dtype[np.uint8]]:
    label, _ = ndimage.label(safe_map(), EIGHT)
    return (label == 1 + np.argmax(np.bincount(label.ravel())[1:])).astype(np.uint8)


def component_cases() -> Iterator[Case]:
    cells = safe_map()
    bits = packed(cells)
    yield "own, runs and boxes of all", lambda: components(bits, bits)
    yield "SciPy ndimage.label", lambda: ndimage.label(cells, EIGHT)
    if cv2 := library("cv2"):
        yield "OpenCV connectedComponentsWithStats", lambda: cv2.connectedComponentsWithStats(cells)
    if measure := library("skimage.measure"):
        yield "scikit-image measure.label", lambda: measure.label(cells)


def distance_cases() -> Iterator[Case]:
    cells = largest_zone()
    bits = packed(cells)
    corners = packed(
        ndimage.binary_erosion(cells, np.ones((SQUARE, SQUARE)), origin=-SQUARE // 2).view(np.uint8)
    )
    yield "own, largest square and farthest cells", lambda: square_and_clearance(bits, corners, SQUARE)
    yield "SciPy distance_transform_edt", lambda: ndimage.distance_transform_edt(cells).max()
    yield "SciPy distance_transform_cdt (square)", lambda: ndimage.distance_transform_cdt(cells).max()
    if cv2 := library("cv2"):
        for what, kind in (("L2", cv2.DIST_L2), ("C (square)", cv2.DIST_C)):
            size = cv2.DIST_MASK_PRECISE if kind == cv2.DIST_L2 else 3
            yield (
                f"OpenCV distanceTransform {what}",
                lambda k=kind, s=size: cv2.distanceTransform(cells, k, s).max(),
            )


def morphology_cases() -> Iterator[Case]:
    cells = safe_map()
    bits, cv2 = packed(cells), library("cv2")
    yield "own, closing", lambda: closed(bits, RADIUS, SIDE)
    yield "own, dilation", lambda: dilated(bits, RADIUS, SIDE)
    yield "own, erosion", lambda: eroded(bits, RADIUS, SIDE)
    yield "own, bytes to bits and back", lambda: unpacked(packed(cells), 0, SIDE)
    yield "SciPy binary_closing", lambda: ndimage.binary_closing(cells, BLOCK)
    yield "SciPy maximum_filter (dilation)", lambda: ndimage.maximum_filter(cells, 2 * RADIUS + 1)
    yield "SciPy minimum_filter (erosion)", lambda: ndimage.minimum_filter(cells, 2 * RADIUS + 1)
    if cv2:
        yield "OpenCV closing", lambda: cv2.morphologyEx(cells, cv2.MORPH_CLOSE, BLOCK)
        yield "OpenCV dilation", lambda: cv2.dilate(cells, BLOCK)
        yield "OpenCV erosion", lambda: cv2.erode(cells, BLOCK)


def tracing_cases() -> Iterator[Case]:
    cells = ndimage.binary_fill_holes(largest_zone()).astype(np.uint8)
    bits = packed(cells)
    row, col = map(int, np.argwhere(cells)[0])
    path, edges = np.empty((100_000, 2), np.int32), np.empty(100_000, np.uint8)
    yield "own, from a given start", lambda: trace_boundary(bits, row, col, path, edges)
    if cv2 := library("cv2"):
        how = cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        yield "OpenCV findContours", lambda: cv2.findContours(cells, *how)
    if measure := library("skimage.measure"):
        yield "scikit-image find_contours", lambda: measure.find_contours(cells, 0.5)


def voxel_cases() -> Iterator[Case]:
    """180,000 returns of uneven ground in a circle of 30 m, turn by turn, 1 % of them isolated."""
    rng = np.random.default_rng(3)
    turn, away = np.arange(180_000) * 0.02, rng.uniform(0, 1, 180_000)
    points = np.stack([30 * away * np.cos(turn), 30 * away * np.sin(turn), rng.uniform(0, 0.1, 180_000)], 1)
    points[::100, 2] = rng.uniform(0.5, 30, 1800)
    sensor = np.array([0.0, 0.0, 40.0])
    yield "own", lambda: not_isolated(points, sensor, CELL_M)
    yield (
        "SciPy cKDTree, build and count in radius",
        lambda: cKDTree(points).query_ball_point(points, 1.5 * VOXEL_M, return_length=True),
    )
    if o3d := library("open3d"):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        yield (
            "Open3D remove_radius_outlier",
            lambda: cloud.remove_radius_outlier(LEAST_SUPPORT, 1.5 * VOXEL_M),
        )


def simplification_cases() -> Iterator[Case]:
    cells = noisy("disc", 1)
    rough = shapely.MultiPolygon([shapely.Polygon(p.outer, p.holes) for p in polygonise(cells, 0.0)])
    stays = shapely.contains(rough, shapely.simplify(rough, 1.0))
    yield "own, from cells to polygon", lambda: polygonise(cells)
    yield f"Shapely simplify (stays inside: {stays})", lambda: shapely.simplify(rough, 1.0)
    yield "Shapely coverage_simplify", lambda: shapely.coverage_simplify([rough], 1.0)


def median_cases() -> Iterator[Case]:
    image = np.random.default_rng(4).normal(100.0, 1.0, (128, 128))
    holed = np.where(np.random.default_rng(5).random(image.shape) < 0.05, np.nan, image)
    yield "own with NumPy, missing pixels left out", lambda: median_of_neighbours(holed)
    yield (
        "SciPy generic_filter(nanmedian)",
        lambda: ndimage.generic_filter(holed, np.nanmedian, 3, mode="constant", cval=np.nan),
    )
    yield "SciPy median_filter (none missing)", lambda: ndimage.median_filter(image, 3)
    if cv2 := library("cv2"):
        single = image.astype(np.float32)
        yield "OpenCV medianBlur (none missing, float32)", lambda: cv2.medianBlur(single, 3)


def unwrapping_cases() -> Iterator[Case]:
    row, col = np.indices((200, 200))
    true = 0.02 * np.hypot(row - 80, col - 120) ** 1.5 + np.random.default_rng(6).normal(0, 0.2, row.shape)
    phase = (true + np.pi) % (2 * np.pi) - np.pi
    quality = np.where(abs(row - col) < 3, 0.0, 0.9)
    masked = np.ma.masked_array(phase, quality < 0.5)
    yield "own, with numbers of regions", lambda: unwrap_by_quality(phase, quality, 0.5)
    if restoration := library("skimage.restoration"):
        yield "scikit-image unwrap_phase", lambda: restoration.unwrap_phase(masked, rng=0)


CASES: dict[str, Callable[[], Iterator[Case]]] = {
    "components": component_cases,
    "distances": distance_cases,
    "morphology": morphology_cases,
    "tracing": tracing_cases,
    "voxels": voxel_cases,
    "simplification": simplification_cases,
    "median": median_cases,
    "unwrapping": unwrapping_cases,
}


if __name__ == "__main__":
    main()
