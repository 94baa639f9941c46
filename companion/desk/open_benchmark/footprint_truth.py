"""Truth of a frozen scene: slope and relief of the exact surface under each footprint.

It shares no code with `slz` or with the simulator. The surface is sampled at a lattice of 2.5 cm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from companion.desk.open_benchmark.frozen_scenes import HALF_M, JUDGED_M, WATER, FrozenScene
from companion.desk.open_benchmark.hazard_shapes import Cable, Shape
from companion.desk.open_benchmark.landing_task import F64, SAFE, U8, UNKNOWN, UNSAFE, LandingTask

PITCH_M = 0.025
NODES = round(2 * HALF_M / PITCH_M) + 1
SLOPE = "slope"
"""Kind of unsafe ground on which nothing stands."""
LEAST_RISE_M = 1e-3  # of a shape that makes a footprint one of its kind


@dataclass(frozen=True, slots=True)
class SceneTruth:
    """Rasters on the task's grid, row 0 the southernmost.

    safe: 0 unsafe, 1 safe, 255 not judged. kind: index into `kinds` of the hazard of unsafe cells, 255
    elsewhere. slope_deg, relief_m: of the surface under the footprint; NaN where not judged.
    """

    safe: U8
    kind: U8
    kinds: tuple[str, ...]
    slope_deg: F64
    relief_m: F64


def lattice() -> tuple[F64, F64]:
    """Return x (1, n) and y (n, 1) of the lattice."""
    axis = np.arange(-(NODES // 2), NODES // 2 + 1).astype(np.float64) * PITCH_M
    return axis[None, :], axis[:, None]


def lattice_heights(scene: FrozenScene) -> F64:
    """Return the exact heights (n, n) of the lattice."""
    z = scene.ground.height_m(*lattice())
    for shape in scene.shapes:
        _add_rise(z, shape)
    return z


def _add_rise(z: F64, shape: Shape) -> None:
    """Add a shape to heights of the lattice, in place, where it is not 0."""
    circle = shape.bounds
    part = [slice(None), slice(None)]
    if math.isfinite(circle.radius_m):
        for axis, centre in enumerate((circle.y_m, circle.x_m)):
            low, high = (centre + sign * circle.radius_m for sign in (-1, 1))
            part[axis] = slice(max(0, _node(low) - 1), max(0, _node(high) + 2))
    x, y = lattice()
    z[part[0], part[1]] += shape.rise_m(x[:, part[1]], y[part[0]])


def scene_truth(scene: FrozenScene, task: LandingTask, surface_m: F64 | None = None) -> SceneTruth:
    """Judge the cells whose footprints are well inside a scene.

    A cell is safe if the best-fit plane of the footprint's surface is not steeper than the limit, the
    surface reaches no further from peak to peak about it than the limit, no water is in the footprint and no
    wire above it (limits inclusive). Unsafe cells are of the kind that raises or lowers the ground most
    within the footprint; those below a wire are of its kind where the ground itself is safe.

    Parameters
    ----------
    surface_m
        Heights of the lattice, if they are known already.
    """
    z = lattice_heights(scene) if surface_m is None else surface_m
    grid, half = task.grid, round(task.footprint_m / 2 / PITCH_M)
    east, north = grid.centres()
    judged = (np.abs(east) < JUDGED_M) & (np.abs(north) < JUDGED_M)
    rows, cols = (np.flatnonzero(judged.any(axis=axis)) for axis in (1, 0))
    first, step = _node(float(east[0, cols[0]])), round(grid.cell_m / PITCH_M)
    windows = sliding_window_view(z, (2 * half + 1, 2 * half + 1))
    nodes = first - half + step * np.arange(len(cols)), _node(float(north[rows[0], 0])) - half
    slope, relief = (np.full(grid.shape, np.nan) for _ in range(2))
    for k, row in enumerate(rows):
        slope[row, cols], relief[row, cols] = _planes(windows[nodes[1] + k * step, nodes[0]], half)
    hung = np.zeros(grid.shape, bool)
    for cable in scene.cables:
        hung |= below_cable(cable, east, north, task.footprint_m)
    touched = _touched(scene, grid.shape, (rows, cols), (nodes[1], nodes[0]), half, step)
    wet = np.zeros(grid.shape, bool)
    if WATER in scene.kinds:
        wet = touched[scene.kinds.index(WATER)] > LEAST_RISE_M
    rough = (slope > task.slope_limit_deg) | (relief > task.relief_limit_m) | wet
    safe = np.where(rough | hung, UNSAFE, SAFE)
    kinds = tuple(dict.fromkeys((*scene.kinds, SLOPE)))
    kind = np.full(grid.shape, kinds.index(SLOPE))
    if len(touched):
        most = touched.argmax(axis=0)
        kind = np.where(touched.max(axis=0) > LEAST_RISE_M, most, kind)
    if scene.cables:
        kind = np.where(rough, kind, kinds.index(scene.cables[0].kind))
    return SceneTruth(
        np.where(judged, safe, UNKNOWN).astype(np.uint8),
        np.where(judged & (safe == UNSAFE), kind, UNKNOWN).astype(np.uint8),
        kinds,
        slope,
        relief,
    )


def below_cable(cable: Cable, east: F64, north: F64, footprint_m: float) -> NDArray[np.bool_]:
    """Return whether a straight wire crosses the square footprints about centres, seen from above.

    The square, grown by the wire's radius, is clipped by its two pairs of sides (Liang-Barsky).
    """
    reach = footprint_m / 2 + cable.radius_m
    enter, leave = np.zeros(east.shape), np.ones(east.shape)
    for centre, start, end in zip((east, north), cable.from_m[:2], cable.to_m[:2], strict=True):
        run = end - start
        if run == 0.0:
            enter = np.where(np.abs(start - centre) <= reach, enter, 2.0)
            continue
        a, b = (centre - reach - start) / run, (centre + reach - start) / run
        enter, leave = np.maximum(enter, np.minimum(a, b)), np.minimum(leave, np.maximum(a, b))
    return np.asarray(enter <= leave)


def _node(at_m: float) -> int:
    return round(at_m / PITCH_M) + NODES // 2


def _planes(windows: F64, half: int) -> tuple[F64, F64]:
    """Return slope (deg) and relief (m) of (n, m, m) heights about their best-fit planes.

    The lattice is symmetric about the centre, so that the normal equations are diagonal.
    """
    offset = np.arange(-half, half + 1) * PITCH_M
    spread = len(offset) * float(np.sum(offset**2))
    gx = windows.sum(axis=1) @ offset / spread
    gy = windows.sum(axis=2) @ offset / spread
    plane = gy[:, None, None] * offset[None, :, None] + gx[:, None, None] * offset[None, None, :]
    rest = windows - plane
    relief = rest.max(axis=(1, 2)) - rest.min(axis=(1, 2))
    return np.degrees(np.arctan(np.hypot(gx, gy))), relief


def _touched(
    scene: FrozenScene,
    shape: tuple[int, int],
    cells: tuple[NDArray[np.int64], NDArray[np.int64]],
    nodes: tuple[int, NDArray[np.int64]],
    half: int,
    step: int,
) -> F64:
    """Return (kinds, rows, cols) greatest rise or fall by the shapes of a kind within each footprint."""
    out = np.zeros((len(scene.kinds), *shape))
    rows, cols = cells
    down = nodes[0] + half + step * np.arange(len(rows))
    for index, kind in enumerate(scene.kinds):
        rise = np.zeros((NODES, NODES))
        for part in scene.shapes:
            if part.kind == kind:
                _add_rise(rise, part)
        most = np.abs(rise)
        for axis in (0, 1):
            most = maximum_filter1d(most, 2 * half + 1, axis=axis, mode="nearest")
        out[index][np.ix_(rows, cols)] = most[np.ix_(down, nodes[1] + half)]
    return out
