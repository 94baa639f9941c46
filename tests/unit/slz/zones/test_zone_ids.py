"""Identity of zones: the sources' filter of repeated zones, and default mode's IDs from map to map."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz import UNSAFE, Pipeline, Report, Zone
from slz.grid import Box
from slz.kernels.raster.bitmap import packed
from slz.zones.tracking import ZoneTracker
from tests.unit.slz.hand_made import fly, returns, state_at, window

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Patch:
    """Rows and columns of ground, half open."""

    row0: int
    row1: int
    col0: int
    col1: int


def canvas(*patches: Patch, side: int = 60) -> Floats:
    """Level ground where a patch is, nothing elsewhere."""
    height = np.full((side, side), np.nan)
    for patch in patches:
        height[patch.row0 : patch.row1, patch.col0 : patch.col1] = 0.0
    return height


def raised(height: Floats, patch: Patch, up_m: float) -> Floats:
    """The same with something on it."""
    height = height.copy()
    height[patch.row0 : patch.row1, patch.col0 : patch.col1] += up_m
    return height


def ids(report: Report) -> list[int]:
    return sorted(zone.id for zone in report.zones)


def by_id(report: Report, zone_id: int) -> Zone:
    (zone,) = (zone for zone in report.zones if zone.id == zone_id)
    return zone


# ---- source mode (SLZ paper, section 3.4.3) -------------------------------------------------------------

BASE = Patch(5, 45, 5, 45)
TAB = Patch(45, 49, 10, 22)  # at the northern edge of BASE
STRIP = Patch(5, 45, 45, 57)  # along its whole eastern edge


def source(*own: str) -> Pipeline:
    fixed = ["mode=source", "zone_m=200", "histogram_threshold=1", "min_square_m=5", "min_boundary_points=10"]
    return Pipeline(params.load("helicopter", [*fixed, *own]), (0.0, 0.0))


def seen(*heights: Floats, pipe: Pipeline) -> Report:
    return fly(pipe, *(returns(height, 1.0) for height in heights))


def repetition_ratio(new: Zone, old: Zone) -> float:
    """RR of Eq. 18."""
    inside = [old.holds(int(row), int(col)) for row, col in new.boundary_cells]
    return sum(inside) / len(inside)


def tabbed_and_walled() -> Floats:
    """The base, a tab beside it, and a low wall that cuts off its eastern fifth, too narrow for a zone."""
    return raised(canvas(BASE, TAB), Patch(5, 45, 38, 39), 0.5)


def test_source_a_zone_seen_again_is_the_same_zone() -> None:
    pipe = source()
    first = seen(canvas(BASE), pipe=pipe)
    again = seen(canvas(BASE), canvas(BASE), pipe=pipe)
    assert ids(first) == ids(again) == [1]
    assert again.zones[0].area_m2 == first.zones[0].area_m2 == 38 * 38


def test_source_a_zone_within_the_old_one_is_ignored_though_it_shrank() -> None:
    """RR = 1. The map knows of the wall; the zone drawn on it does not."""
    pipe = source()
    first = seen(canvas(BASE), pipe=pipe)
    after = seen(raised(canvas(BASE), Patch(5, 45, 20, 22), 0.5), pipe=pipe)
    assert state_at(pipe, 20.5, 25.5) == UNSAFE
    assert ids(after) == [1]
    np.testing.assert_array_equal(after.zones[0].cells, first.zones[0].cells)
    assert after.zones[0].holds(*after.grid.index(20.5, 25.5))


def test_source_a_zone_that_grew_a_little_takes_the_old_one_s_id_and_place() -> None:
    pipe = source()
    first = seen(canvas(BASE), pipe=pipe)
    after = seen(canvas(BASE, TAB), pipe=pipe)
    assert ids(after) == [1]
    assert after.zones[0].area_m2 > first.zones[0].area_m2
    assert after.zones[0].holds(*after.grid.index(15.5, 47.5))


def test_source_of_a_zone_that_grew_much_old_and_new_both_live() -> None:
    pipe = source()
    first = seen(canvas(BASE), pipe=pipe)
    after = seen(canvas(BASE, STRIP), pipe=pipe)
    assert ids(after) == [1, 2]
    assert by_id(after, 1).area_m2 == first.zones[0].area_m2
    assert repetition_ratio(by_id(after, 2), by_id(after, 1)) < 0.8


def test_source_of_a_zone_that_grew_and_lost_more_than_a_tenth_old_and_new_both_live() -> None:
    pipe = source()
    after = seen(canvas(BASE), tabbed_and_walled(), pipe=pipe)
    assert ids(after) == [1, 2]
    assert repetition_ratio(by_id(after, 2), by_id(after, 1)) > 0.8
    assert by_id(after, 2).area_m2 < 0.9 * by_id(after, 1).area_m2


@pytest.mark.parametrize(("below", "names"), [(0.0, [1, 2]), (1e-9, [1])])
def test_source_the_ratio_of_repetition_must_be_exceeded(below: float, names: list[int]) -> None:
    both = seen(canvas(BASE), canvas(BASE, TAB), pipe=source("repeat_ratio=1"))
    ratio = repetition_ratio(by_id(both, 2), by_id(both, 1))
    assert 0.8 < ratio < 1
    after = seen(canvas(BASE), canvas(BASE, TAB), pipe=source(f"repeat_ratio={ratio - below!r}"))
    assert ids(after) == names


@pytest.mark.parametrize(("below", "names"), [(0.0, [1, 2]), (1e-9, [1])])
def test_source_the_ratio_of_areas_must_be_exceeded(below: float, names: list[int]) -> None:
    both = seen(canvas(BASE), tabbed_and_walled(), pipe=source("area_ratio=1"))
    old, new = by_id(both, 1).area_m2, by_id(both, 2).area_m2
    ratio = new / old
    assert ratio * old == new  # no rounding, so the areas are equal to the limit
    after = seen(canvas(BASE), tabbed_and_walled(), pipe=source(f"area_ratio={ratio - below!r}"))
    assert ids(after) == names


def morphing() -> list[Floats]:
    """Six windows of one field: every one shows another bay that was not seen before."""
    bays = [Patch(45, 48, 6 + 7 * i, 12 + 7 * i) for i in range(5)]
    return [canvas(BASE, *bays[:n]) for n in range(6)]


def test_source_six_detections_of_a_morphing_zone_are_one_zone() -> None:
    """SLZ paper Figure 14."""
    pipe = source()
    for height in morphing():
        after = seen(height, pipe=pipe)
        assert ids(after) == [1]
    assert after.zones[0].area_m2 > 38 * 38 + 5 * 3 * 4


def test_source_without_the_rule_six_detections_of_a_morphing_zone_are_six_zones() -> None:
    """SLZ paper Figure 13."""
    assert ids(seen(*morphing(), pipe=source("repeat_ratio=1"))) == [1, 2, 3, 4, 5, 6]


def test_source_a_zone_elsewhere_is_another_and_the_first_one_lives_on_unseen() -> None:
    near, far = Patch(2, 20, 2, 20), Patch(30, 50, 30, 50)
    after = seen(canvas(near), canvas(far), pipe=source())
    assert ids(after) == [1, 2]
    assert by_id(after, 1).holds(*after.grid.index(10.5, 10.5))
    assert by_id(after, 2).holds(*after.grid.index(40.5, 40.5))


@pytest.mark.parametrize(("depth", "names"), [(1, [1, 2, 3, 4]), (2, [1, 2])])
def test_source_only_so_many_earlier_zones_are_compared(depth: int, names: list[int]) -> None:
    both = canvas(Patch(2, 20, 2, 20), Patch(30, 50, 30, 50))
    assert ids(seen(both, both, pipe=source(f"repeat_depth={depth}"))) == names


def test_source_a_zone_keeps_its_id_when_the_map_moves() -> None:
    pipe = source("zone_m=140")
    ground = returns(canvas(BASE), 1.0)
    before = fly(pipe, ground)
    after = fly(pipe, np.vstack([[[80.5, 20.5, 0.0]], ground]))
    assert after.grid != before.grid
    assert ids(before) == ids(after) == [1]
    assert after.zones[0].holds(*after.grid.index(25.5, 25.5))
    assert not after.zones[0].holds(*after.grid.index(46.5, 25.5))


# ---- default mode -------------------------------------------------------------------------------

CELL_M = 0.5
FIELD = Patch(4, 54, 4, 44)
REST = Patch(4, 54, 44, 58)


def default(*own: str) -> Pipeline:
    fixed = [f"cell_m={CELL_M}", "zone_m=100", "coverage_m=1", "hold_s=0.5", "min_boundary_points=10"]
    return Pipeline(params.load("quadcopter", [*fixed, "min_square_m=2", *own]), (0.0, 0.0))


def looked(pipe: Pipeline, *heights: Floats) -> Report:
    return fly(pipe, *(returns(height, CELL_M) for height in heights))


def id_at(report: Report, row: int, col: int) -> int | None:
    """The ID of the zone at a cell of the canvas."""
    where = report.grid.index((col + 0.5) * CELL_M, (row + 0.5) * CELL_M)
    return next((zone.id for zone in report.zones if zone.holds(*where)), None)


def test_a_zone_that_grows_keeps_its_id() -> None:
    pipe = default()
    before = looked(pipe, canvas(FIELD))
    after = looked(pipe, canvas(FIELD, REST))
    assert ids(before) == ids(after) == [1]
    assert after.zones[0].area_m2 > 1.2 * before.zones[0].area_m2


def test_a_zone_that_shrinks_keeps_its_id_and_shrinks_at_once() -> None:
    pipe = default()
    before = looked(pipe, canvas(FIELD))
    after = looked(pipe, raised(canvas(FIELD), Patch(4, 54, 20, 44), 1.5))
    lower = id_at(after, 30, 10)
    assert lower == before.zones[0].id == 1
    assert by_id(after, 1).area_m2 < 0.5 * before.zones[0].area_m2


@pytest.mark.parametrize("small_first", [True, False])
def test_of_two_zones_that_merge_the_id_of_the_larger_share_lives(small_first: bool) -> None:
    """Whichever of them comes first in the raster, and so had the lower ID."""
    small, gap, large = Patch(2, 16, 2, 50), Patch(16, 24, 2, 50), Patch(24, 58, 2, 50)
    if not small_first:
        small, gap, large = Patch(44, 58, 2, 50), Patch(36, 44, 2, 50), Patch(2, 36, 2, 50)
    pipe = default()
    apart = looked(pipe, canvas(small, large))
    assert ids(apart) == [1, 2]
    larger = max(apart.zones, key=lambda zone: zone.area_m2).id
    assert larger == (2 if small_first else 1)
    assert ids(looked(pipe, canvas(small, gap, large))) == [larger]


@pytest.mark.parametrize("wall_col", [16, 32])
def test_of_a_zone_that_splits_the_larger_part_keeps_the_id_and_the_other_gets_a_new_one(
    wall_col: int,
) -> None:
    pipe = default()
    looked(pipe, canvas(FIELD))
    after = looked(pipe, raised(canvas(FIELD), Patch(4, 54, wall_col, wall_col + 2), 1.5))
    smaller, larger = id_at(after, 30, 8), id_at(after, 30, 40)
    if wall_col == 32:
        smaller, larger = larger, smaller
    assert larger == 1
    assert smaller not in (None, 1)


def test_of_a_zone_that_splits_evenly_one_part_keeps_the_id() -> None:
    pipe = default()
    looked(pipe, canvas(FIELD))
    after = looked(pipe, raised(canvas(FIELD), Patch(4, 54, 23, 25), 1.5))
    first, second = after.zones
    assert first.area_m2 == second.area_m2
    assert sorted(zone.id == 1 for zone in (first, second)) == [False, True]


def test_an_id_lost_in_a_merge_is_given_to_nothing_else() -> None:
    """The part that comes apart again, elsewhere than the zone that had the ID, gets one never used."""
    small, gap, large = Patch(4, 54, 4, 16), Patch(4, 54, 16, 24), Patch(4, 54, 24, 58)
    pipe = default("water_suspicion=1")  # dead level between walls, it may be a canal
    apart = looked(pipe, canvas(small, large))
    merged = looked(pipe, canvas(small, gap, large))
    rubble = Patch(4, 54, 2, 26)  # where the small one was
    again = looked(pipe, raised(raised(canvas(small, gap, large), rubble, 1.5), Patch(4, 54, 44, 46), 1.5))
    assert ids(merged) == [id_at(apart, 30, 50)]
    assert id_at(again, 30, 36) == id_at(apart, 30, 36)
    assert id_at(again, 30, 53) not in (None, *ids(apart))


def test_a_zone_that_vanishes_takes_its_id_along_and_one_that_appears_gets_another() -> None:
    pipe = default()
    west, east = Patch(4, 54, 4, 24), Patch(4, 54, 34, 58)
    rubble = canvas(west)
    rubble[::2, ::2] += 1.0
    assert ids(looked(pipe, canvas(west))) == [1]
    assert ids(looked(pipe, rubble)) == []
    after = looked(pipe, canvas(east))
    assert len(after.zones) == 1
    assert id_at(after, 30, 46) not in (None, 1)


def test_a_zone_that_appears_where_one_vanished_is_that_one_again() -> None:
    pipe = default()
    west = Patch(4, 54, 4, 24)
    rubble = canvas(west)
    rubble[::2, ::2] += 1.0
    assert ids(looked(pipe, canvas(west))) == [1]
    assert ids(looked(pipe, rubble)) == []
    assert ids(fly(pipe, *(returns(canvas(west), CELL_M) for _ in range(3)), first_s=3.0)) == [1]


def test_a_zone_out_of_sight_keeps_its_id_until_it_is_too_old() -> None:
    pipe = default("max_age_s=10")
    west, east = Patch(4, 54, 4, 24), Patch(4, 54, 34, 58)
    fly(pipe, returns(canvas(west), CELL_M))
    both = fly(pipe, returns(canvas(east), CELL_M), first_s=5.0)
    late = fly(pipe, returns(canvas(east), CELL_M), first_s=12.0)
    assert id_at(both, 30, 14) == 1
    assert ids(late) == [id_at(both, 30, 46)]
    assert ids(late) != [1]


def test_a_zone_keeps_its_id_when_the_map_moves_with_the_vehicle() -> None:
    pipe = default("register_m=0")
    ground = returns(canvas(FIELD, side=60), CELL_M)
    before = pipe.process(window(ground, 0.0, (10.0, 10.0, 20.0)))
    after = pipe.process(window(ground, 1.0, (30.0, 10.0, 20.0)))
    assert after.grid.west_m != before.grid.west_m
    assert ids(before) == ids(after) == [1]
    assert id_at(after, 30, 20) == id_at(before, 30, 20) == 1


# ---- over any maps ------------------------------------------------------------------------------

SIDE = 56


def random_maps(seed: int, n: int) -> list[Floats]:
    """Windows of patches that come and go, some as before, with things on them that come and go."""
    rng = np.random.default_rng(seed)

    def patch(least: int, most: int) -> Patch:
        (row, col), (high, wide) = rng.integers(0, SIDE - least, 2), rng.integers(least, most, 2)
        return Patch(row, row + high, col, col + wide)

    heights: list[Floats] = []
    for _ in range(n):
        if heights and rng.random() < 0.3:
            heights.append(heights[-1])
            continue
        height = canvas(*(patch(8, 22) for _ in range(rng.integers(1, 4))), side=SIDE)
        for _ in range(rng.integers(0, 3)):
            height = raised(height, patch(1, 16), 1.0)
        heights.append(height)
    return heights


def watch(pipe: Pipeline, heights: list[Floats], cell_m: float) -> list[Report]:
    return [fly(pipe, returns(height, cell_m), first_s=i) for i, height in enumerate(heights)]


def same_cells(a: Zone, b: Zone) -> bool:
    return a.box == b.box and bool((a.cells == b.cells).all())


def share_a_cell(a: Zone, b: Zone, report: Report) -> bool:
    whole = np.zeros((2, report.grid.rows, report.grid.cols), np.uint8)
    for layer, zone in zip(whole, (a, b), strict=True):
        layer[zone.box.slices] = zone.cells
    return bool((whole[0] & whole[1]).any())


flights = given(st.integers(0, 10_000), st.integers(2, 5))


def aged() -> Pipeline:
    return default("zone_m=70", "max_age_s=2", "footprint_m=1")


@settings(max_examples=30, deadline=None)
@flights
def test_ids_are_unique_and_a_zone_that_did_not_change_keeps_its_id(seed: int, n: int) -> None:
    before: tuple[Zone, ...] = ()
    for report in watch(aged(), random_maps(seed, n), CELL_M):
        assert len(set(ids(report))) == len(report.zones)
        for zone in report.zones:
            assert all(old.id == zone.id for old in before if same_cells(old, zone))
        before = report.zones


@settings(max_examples=30, deadline=None)
@flights
def test_an_id_is_given_only_to_ground_that_shares_some_with_what_bore_it_before(seed: int, n: int) -> None:
    borne: list[Zone] = []
    for report in watch(aged(), random_maps(seed, n), CELL_M):
        for zone in report.zones:
            earlier = [old for old in borne if old.id == zone.id]
            assert not earlier or any(share_a_cell(old, zone, report) for old in earlier)
        borne += report.zones


@settings(max_examples=30, deadline=None)
@flights
def test_source_ids_are_unique_and_none_is_ever_lost(seed: int, n: int) -> None:
    before: list[int] = []
    for report in watch(source("zone_m=120"), random_maps(seed, n), 1.0):
        assert len(set(ids(report))) == len(report.zones)
        assert set(before) <= set(ids(report))
        before = ids(report)


def test_the_random_flights_hold_every_case() -> None:
    """Else the tests above would say nothing."""
    kept = changed = lost = fresh = 0
    for seed in range(12):
        before: tuple[Zone, ...] = ()
        for report in watch(aged(), random_maps(seed, 5), CELL_M):
            for zone in report.zones:
                old = [z for z in before if z.id == zone.id]
                kept += any(same_cells(z, zone) for z in old)
                changed += any(not same_cells(z, zone) for z in old)
                fresh += bool(before) and not old
            lost += len({z.id for z in before} - set(ids(report)))
            before = report.zones
    assert min(kept, changed, lost, fresh) >= 10


def test_a_name_that_two_zones_claim_alike_goes_to_the_first() -> None:
    """Their common ground with the old zone is as large; which comes first is where they were found."""
    numbers = itertools.count(1)
    tracker = ZoneTracker(numbers)

    def candidate(col: int, width: int) -> Any:
        box = Box(0, 4, col, col + width)
        bits = packed(np.ones(box.shape, np.uint8))
        return SimpleNamespace(box=box, own_bits=bits, words_box=Box(0, 4, col, col + 64))

    def named(one: Any, number: int) -> Any:
        return SimpleNamespace(**vars(one), id=number)

    (old,) = tracker.update([candidate(0, 12)], named)
    first, second = tracker.update([candidate(0, 5), candidate(7, 5)], named)
    assert (first.id, second.id) == (old.id, 2)
