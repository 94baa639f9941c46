"""Hand-made ground, one height per cell, and windows of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz import LocalFrame, Pipeline, Report, TerrainMaps, Window

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
NOWHERE = (float("nan"), float("nan"), float("nan"))


def returns(height_m: Floats, cell_m: float, west_m: float = 0.0, south_m: float = 0.0) -> Floats:
    """One return in the middle of every cell (row 0 is the southernmost), none where the height is NaN."""
    rows, cols = np.nonzero(np.isfinite(height_m))
    east, north = west_m + (cols + 0.5) * cell_m, south_m + (rows + 0.5) * cell_m
    return np.column_stack([east, north, height_m[rows, cols]])


def flat(rows: int, cols: int) -> Floats:
    return np.zeros((rows, cols))


def window(
    points: Floats,
    second: float = 0.0,
    sensor: tuple[float, float, float] = NOWHERE,
    frame: LocalFrame = FRAME,
) -> Window:
    """A window whose returns are all of one moment; without a sensor's place, as of a stored cloud."""
    at = np.array(points, np.float64)
    stamp = round(second * 1e9)
    return Window(at, np.full(len(at), stamp, np.int64), np.array(sensor, np.float64), FRAME, stamp, stamp)


def fly(pipe: Pipeline, *clouds: Floats, every_s: float = 1.0, first_s: float = 0.0) -> Report:
    """Windows of a stored cloud one after the other; the last report."""
    reports = [pipe.process(window(cloud, first_s + i * every_s)) for i, cloud in enumerate(clouds)]
    return reports[-1]


def maps(pipe: Pipeline) -> TerrainMaps:
    found = pipe.maps()
    assert found is not None
    return found


def at(pipe: Pipeline, layer: str, east_m: float, north_m: float) -> float:
    """The value of a map at a place."""
    m = maps(pipe)
    row, col = m.grid.index(east_m, north_m)
    return float(getattr(m, layer)[row - m.box.row0, col - m.box.col0])


def state_at(pipe: Pipeline, east_m: float, north_m: float) -> int:
    return int(at(pipe, "state", east_m, north_m))


def near_map(pipeline: Pipeline) -> Any:
    """Return the near map of a pipeline that has processed a window."""
    maps = pipeline.method.maps
    assert maps is not None
    return maps[0]
