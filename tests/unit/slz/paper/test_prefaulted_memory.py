"""Prefaulted memory for the next window: it changes nothing but the time."""

from __future__ import annotations

import resource
import sys

import numpy as np
import pytest

import params
from slz import LocalFrame, Pipeline, Report, Window
from slz.grid import Box
from slz.kernels.array_memory import demand_zeros, prefault_range
from slz.kernels.cells.cell_record import TILE
from slz.paper import paper_terrain
from slz.terrain.tiled_raster import TiledLayers

FRAME = LocalFrame(45.0, -75.0, 0.0)
PARAMETERS = params.load(
    "quadcopter", ["mode=source", "cell_m=0.5", "zone_m=120", "min_square_m=3", "min_boundary_points=8"]
)
ROWS, COLS = slice(100, 500), slice(3, 9)


def window(number: int, *, stray: bool = False) -> Window:
    """Return a window of rough ground with a plain in it, moving on by 4 m; one return may be a stray."""
    rng = np.random.default_rng(number)
    n = 4500
    east, north = rng.uniform(-14, 14, n) + 4 * number - 12, rng.uniform(-14, 14, n)
    height = np.where(np.hypot(east, north) < 9, 0.0, rng.normal(0, 0.5, n))
    points = np.column_stack([east, north, height])
    points[0, :2] = -55.0 if stray else points[0, :2]
    stamps = np.full(n, (number + 1) * 1_000_000_000)
    return Window(points, stamps, np.full(3, np.nan), FRAME, int(stamps[0]), int(stamps[0]))


def told(report: Report) -> list[tuple[object, ...]]:
    """Return what is said of the zones."""
    return [
        (zone.id, zone.area_m2, zone.slope_deg, zone.best.enu_m.tolist(), zone.boundary_cells.tobytes())
        for zone in report.near.zones
    ]


@pytest.mark.parametrize("mode", ["source", "default"])
def test_reports_are_the_same_with_and_without_it(mode: str) -> None:
    parameters = PARAMETERS.model_copy(update={"mode": mode})
    ready, plain = (Pipeline(parameters, (0.0, 0.0)) for _ in "rp")
    ready.prepare()
    found = 0
    for number in range(6):
        mine, other = ready.process(window(number)), plain.process(window(number))
        assert told(mine) == told(other)
        found += len(mine.near.zones)
        ready.prepare()
        a, b = ready.maps(), plain.maps()
        assert a is not None
        assert b is not None
        np.testing.assert_array_equal(a.height_m, b.height_m)
        np.testing.assert_array_equal(a.state, b.state)
    assert found


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts the faults of a thread")
def test_what_is_ready_is_written_to_without_a_page_fault() -> None:
    def faults(prepared: bool) -> int:
        values = demand_zeros((600, 12, 512), np.float64)
        if prepared:
            prefault_range(values, ROWS, COLS)
        before = resource.getrusage(resource.RUSAGE_THREAD).ru_minflt
        values[ROWS, COLS] = 1.0
        return resource.getrusage(resource.RUSAGE_THREAD).ru_minflt - before

    assert faults(prepared=True) <= faults(prepared=False) // 100


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts the faults of a thread")
def test_tiles_that_are_ready_are_made_without_a_page_fault() -> None:
    def faults(prepared: bool) -> int:
        layers, box = TiledLayers([np.nan] * 7), Box(0, 8 * TILE, 0, 10 * TILE)
        values, states = np.ones((7, *box.shape), np.float32), np.ones((1, *box.shape), np.uint8)
        layers.write(Box(0, TILE, -TILE, 0), values[:, :TILE, :TILE], states[:, :TILE, :TILE])
        if prepared:
            layers.prepare(80)
        before = resource.getrusage(resource.RUSAGE_THREAD).ru_minflt
        layers.write(box, values, states)
        return resource.getrusage(resource.RUSAGE_THREAD).ru_minflt - before

    assert faults(prepared=False) > 1000
    assert faults(prepared=True) < 50


def test_values_stay_as_they_are() -> None:
    values = demand_zeros((600, 12, 512), np.float32)
    values[:] = np.random.default_rng(1).normal(size=values.shape)
    values[200, 4, ::3] = np.nan
    before = values.tobytes()
    prefault_range(values, ROWS, COLS)
    prefault_range(values, slice(5, 5), COLS)
    assert values.tobytes() == before


def test_it_lies_ahead_and_a_far_return_asks_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[slice, slice]] = []

    def note(_: object, words: slice, rows: slice) -> None:
        asked.append((words, rows))

    monkeypatch.setattr(paper_terrain, "prefault_range", note)
    pipeline = Pipeline(PARAMETERS, (0.0, 0.0), follow=False)
    for number in range(3):
        pipeline.process(window(number))
        pipeline.prepare()
    words, rows = asked[-7]  # of the first of seven arrays
    assert (words.start, words.stop) == (60 // 64, 179 // 64 + 1)  # cells 84 to 139, 8 on, and 32 about
    assert (rows.start, rows.stop) == (60, 180)
    asked.clear()
    pipeline.process(window(3, stray=True))
    pipeline.prepare()
    assert not asked
    pipeline.process(window(21))  # 72 m on: a seventh of the returns lies in the map, and fills its edge
    pipeline.prepare()
    assert not asked
