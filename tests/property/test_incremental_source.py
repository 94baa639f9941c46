"""Incremental search of source mode, against a full search of every window."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz import LocalFrame, Pipeline, Report, Window
from slz.grid import Grid
from slz.kernels.paper.zone_search import search_zones
from slz.paper import paper_detection
from slz.paper.paper_detection import PaperDetection
from slz.paper.paper_terrain import PaperTerrain
from slz.terrain.layers import LAYERS
from slz.terrain.terrain import EvidenceTerrain
from tests.oracle.source_rules import Repeats, distances, interval, largest_square, zones_of

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
NOWHERE = np.full(3, np.nan)
CELL_M, SIDE, LEAST = 0.5, 4, 20
SETTINGS = [f"cell_m={CELL_M}", "zone_m=90", f"min_square_m={SIDE * CELL_M}", f"min_boundary_points={LEAST}"]
PARAMETERS = params.load("quadcopter", ["mode=source", "safe_slope_deg=5", "max_zones=1000", *SETTINGS])


def scan(rng: np.random.Generator) -> Floats:
    """Returns from part of a rough field with steps, ditches and places not seen, and some from birds."""
    east, north = rng.uniform(-35, 35, 2)
    width, depth = rng.uniform(4, 60, 2)
    n = int(rng.uniform(3, 20) * width * depth)
    xy = rng.uniform(-0.5, 0.5, (n, 2)) * [width, depth] + [east, north]
    noise = rng.choice([0.0, 0.005, 0.03])
    z = 0.3 * np.sin(xy[:, 0] / 6) * np.sin(xy[:, 1] / 7) + rng.normal(0, noise, n)
    for _ in range(rng.integers(0, 8)):
        at, size = rng.uniform(-40, 40, 2), rng.uniform(0.5, 6, 2)
        z[(np.abs(xy - at) < size).all(axis=1)] += rng.choice([-0.5, 0.4, 1.5, 4.0])
    hidden = np.hypot(*(xy - rng.uniform(-30, 30, 2)).T) < rng.choice([0.0, 3.0])
    birds = np.column_stack([rng.uniform(-40, 40, (3, 2)), rng.uniform(20, 60, 3)])
    return np.vstack([np.column_stack([xy, z])[~hidden], birds])


def window(points: Floats, second: int) -> Window:
    stamps = np.full(len(points), second * 10**9, np.int64)
    return Window(points, stamps, NOWHERE, FRAME, second * 10**9, second * 10**9)


class Anew:
    """The same windows, and after each a search of the whole map."""

    def __init__(self) -> None:
        grid = Grid.centred(0.0, 0.0, PARAMETERS.zone_m, CELL_M)
        self.terrain = PaperTerrain(grid, PARAMETERS)
        self.repeats = Repeats()

    def process(self, points: Floats) -> None:
        low, high = interval(points[:, 2], PARAMETERS.histogram_bins, PARAMETERS.histogram_threshold)
        self.terrain.add(points[(low <= points[:, 2]) & (points[:, 2] <= high)])
        safe = self.terrain.slope_deg < np.float32(PARAMETERS.safe_slope_deg)
        safe[[0, -1]], safe[:, [0, -1]] = False, False
        self.repeats.update(zones_of(safe, SIDE, LEAST), safe, np.isfinite(self.terrain.height_m))


def same(report: Report, anew: Anew) -> None:
    zones = sorted(report.zones, key=lambda zone: zone.id)
    assert [zone.id for zone in zones] == [kept.id for kept in anew.repeats.kept]
    for zone, kept in zip(zones, anew.repeats.kept, strict=True):
        content = np.zeros(kept.zone.content.shape, bool)
        content[zone.box.slices] = zone.cells == 1
        np.testing.assert_array_equal(content, kept.zone.content)
        assert [tuple(cell) for cell in zone.boundary_cells.tolist()] == kept.zone.boundary
        assert (zone.n_safe, zone.n_safe + zone.n_unsafe) == (kept.n_safe, kept.n_known)
        assert zone.best.square_side_m == largest_square(kept.zone.component) * CELL_M
        away = distances(kept.zone.component)
        here = away[report.grid.index(*zone.best.enu_m[:2])]
        assert here >= away.max() - 0.5
        assert zone.best.clearance_m == pytest.approx((here - 0.5) * CELL_M)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 100_000), st.integers(2, 7))
def test_zones_are_those_of_a_search_of_everything(seed: int, windows: int) -> None:
    rng = np.random.default_rng(seed)
    pipe, anew = Pipeline(PARAMETERS, (0.0, 0.0), follow=False), Anew()
    for second in range(windows):
        points = scan(rng)
        report = pipe.process(window(points, second))
        anew.process(points)
        same(report, anew)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 100_000))
def test_the_order_of_the_points_changes_no_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, two = (PaperTerrain(Grid.centred(0, 0, 90, CELL_M), PARAMETERS) for _ in "ab")
    for _ in range(3):
        points = scan(rng)
        one.add(points)
        two.add(np.vstack([points[:1], rng.permutation(points[1:])]))
        for name in ("heights", "slopes", "roughs", "safe_bits", "known_bits", "blocks"):
            np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 100_000), st.integers(2, 6))
def test_what_is_kept_up_is_bit_for_bit_what_is_made_anew(seed: int, windows: int) -> None:
    """Squares and components, with and without what was kept of the windows before."""
    rng = np.random.default_rng(seed)
    terrain = PaperTerrain(Grid.centred(0, 0, 90, CELL_M), PARAMETERS)
    search = PaperDetection(terrain, SIDE, LEAST)
    for _ in range(windows):
        terrain.add(scan(rng))
        mine = search.update()
        terrain.changed = terrain.grid.everything
        fresh = PaperDetection(terrain, SIDE, LEAST)
        theirs = fresh.update()
        np.testing.assert_array_equal(search.squares, fresh.squares)
        assert [part.box for part in mine] == [part.box for part in theirs]
        for a, b in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(a.boundary_cells, b.boundary_cells)
            np.testing.assert_array_equal(a.content, b.content)
            assert a.n_cells == b.n_cells


def test_a_search_that_failed_is_made_up_for_by_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the zones of the windows after it would be those of the windows before it, and called valid."""
    rng = np.random.default_rng(5)
    terrain = PaperTerrain(Grid.centred(0, 0, 90, CELL_M), PARAMETERS)
    search = PaperDetection(terrain, SIDE, LEAST)
    for _ in range(6):
        terrain.add(scan(rng))
        with monkeypatch.context() as patch:
            patch.setattr(paper_detection, "search_zones", full)
            with pytest.raises(MemoryError):
                search.update()
        mine = search.update()
        assert search.update() is mine
        terrain.changed = terrain.grid.everything
        theirs = PaperDetection(terrain, SIDE, LEAST).update()
        assert [part.box for part in mine] == [part.box for part in theirs]
        for a, b in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(a.content, b.content)


def full(*given: Any) -> None:
    search_zones(*given)
    raise MemoryError


def test_the_scans_make_and_change_zones() -> None:
    """Else the tests above would say nothing."""
    zones, changes = 0, 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        anew = Anew()
        for _ in range(5):
            before = [kept.zone for kept in anew.repeats.kept]
            anew.process(scan(rng))
            changes += sum(old is not kept.zone for old, kept in zip(before, anew.repeats.kept, strict=False))
        zones += len(anew.repeats.kept)
    assert zones > 20
    assert changes > 5


# Maps derived where evidence changed are those of all evidence derived anew, to the last bit.


SENSOR = np.array([0.0, 0.0, 20.0])


def bumpy(rng: np.random.Generator, count: int) -> np.ndarray:
    """Returns scattered over a slope with steps, holes without a return, and a few poles."""
    east, north = rng.uniform(-14, 14, (2, count)) + rng.uniform(-6, 6, (2, 1))
    up = 0.05 * east + 0.15 * (np.floor(east / 3) % 2) + rng.normal(0, 0.02, count)
    up[rng.random(count) < 0.002] += 1.5
    kept = (np.hypot(east % 9 - 4, north % 7 - 3) > 1.1) | (rng.random(count) < 0.02)
    return np.column_stack([east, north, up])[kept]


@pytest.mark.parametrize("profile", ["quadcopter", "helicopter"])
@pytest.mark.parametrize(
    ("seed", "count", "windows", "step_s"), [(1, 3000, 12, 0.1), (2, 600, 20, 1.0), (3, 900, 12, 40.0)]
)
def test_windows_one_by_one_give_the_maps_of_all_evidence(
    profile: str, seed: int, count: int, windows: int, step_s: float
) -> None:
    rng, p = np.random.default_rng(seed), params.load(profile, ["zone_m=80"])
    terrain = EvidenceTerrain(Grid.centred(0.0, 0.0, 80.0, p.cell_m), p)
    for k in range(windows):
        terrain.add(bumpy(rng, count if k < 6 else 40), SENSOR, k * step_s, rng.uniform(-15, 15, (20, 3)))
    anew = terrain.at_level(0)
    box = terrain.seen
    assert np.array_equal(terrain.state(box), anew.state(box))
    for layer in LAYERS:
        own, other = terrain.layer(layer.name, box), anew.layer(layer.name, box)
        assert np.array_equal(own, other, equal_nan=True), layer.name
