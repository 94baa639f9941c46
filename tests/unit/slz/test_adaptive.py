"""Window length and resolution, adapted to density, height and speed (SLZ paper and thesis, future work)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz import Choice, Grid, Pipeline, Report, Window
from slz.adaptive import COARSEST, Adapter
from slz.grid import Box
from slz.kernels.raster.bitmap import bit, packed
from slz.zones.tracking import Held, regridded
from tests.unit.slz.hand_made import FRAME

Floats = NDArray[np.float64]
SIDE_M = 20.0


def field(per_m2: float, side_m: float = SIDE_M, east_m: float = 0.0) -> Floats:
    """Returns evenly over a square of level ground."""
    n = max(1, round(side_m * math.sqrt(per_m2)))
    places = (np.arange(n) + 0.5) * side_m / n - side_m / 2
    east, north = np.meshgrid(places + east_m, places)
    return np.column_stack([east.ravel(), north.ravel(), np.zeros(n * n)])


def window(points: Floats, second: float, sensor: tuple[float, float, float], span_s: float = 1.0) -> Window:
    start, end = round(second * 1e9), round((second + span_s) * 1e9)
    return Window(points, np.full(len(points), start, np.int64), np.array(sensor), FRAME, start, end)


def parameters(*own: str) -> params.Parameters:
    return params.load("quadcopter", ["zone_m=100", "min_boundary_points=5", "register_m=0", *own])


def looks(
    per_m2: float,
    *own: str,
    n: int = 4,
    height_m: float = 10.0,
    speed_ms: float = 0.0,
    span_s: float = 1.0,
    side_m: float = SIDE_M,
) -> list[Choice]:
    """What is chosen after each of so many windows that are all alike."""
    adapter = Adapter(parameters(*own))
    ground = field(per_m2, side_m)
    choices = []
    for i in range(n):
        east_m = speed_ms * i * span_s
        moved = ground + np.array([east_m, 0.0, 0.0])
        choices.append(adapter.choose(window(moved, i * span_s, (east_m, 0.0, height_m), span_s), moved))
    return choices


# ---- what a window was like ---------------------------------------------------------------------


@pytest.mark.parametrize("per_m2", [0.25, 1.0, 4.0, 25.0, 400.0])
def test_density_is_of_the_ground_hit(per_m2: float) -> None:
    (choice,) = looks(per_m2, n=1, side_m=80.0)
    assert choice.density_per_m2 == pytest.approx(per_m2, rel=0.01)
    assert choice.height_m == 10.0
    assert choice.speed_ms == 0.0


def test_density_counts_ground_that_no_sample_of_the_returns_reaches() -> None:
    points, far = field(50.0, 40.0), 7  # returns; every fourth is looked at to guess their extent
    assert len(points) // 20_000 == 4
    points[1 : 4 * far : 4, :2] = np.column_stack([np.arange(far) * 30.0 + 100.5, np.full(far, -90.5)])
    squares = len(np.unique(np.floor(points[:, :2]), axis=0))
    choice = Adapter(parameters()).choose(window(points, 0.0, (0.0, 0.0, 10.0)), points)
    assert choice.density_per_m2 == len(points) / squares


def test_density_does_not_count_the_gap_between_two_fields() -> None:
    points = np.vstack([field(25.0), field(25.0, east_m=500.0)])
    choice = Adapter(parameters()).choose(window(points, 0.0, (0.0, 0.0, 10.0)), points)
    assert choice.density_per_m2 == pytest.approx(25, rel=0.01)


@pytest.mark.parametrize("per_m2", [0.03, 0.3, 1.0, 3.0, 6.0])
def test_density_of_scattered_returns_is_about_right_however_sparse(per_m2: float) -> None:
    n = round(400**2 * per_m2)
    points = np.column_stack([np.random.default_rng(2).uniform(-200, 200, (n, 2)), np.zeros(n)])
    choice = Adapter(parameters()).choose(window(points, 0.0, (0.0, 0.0, 10.0)), points)
    assert choice.density_per_m2 == pytest.approx(per_m2, rel=0.15)


def test_speed_is_over_ground_between_the_ends_of_windows() -> None:
    adapter, points = Adapter(parameters()), field(25.0)
    adapter.choose(window(points, 0.0, (0.0, 0.0, 10.0)), points)
    choice = adapter.choose(window(points, 1.0, (3.0, 4.0, 30.0), 1.5), points)
    assert choice.speed_ms == pytest.approx(5.0 / 1.5)
    assert choice.height_m == 30.0


# ---- window length ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("per_m2", "window_s"), [(2000, 0.5), (400, 0.5), (200, 1.0), (133, 1.5), (100, 2.0), (4, 2.0)]
)
def test_the_window_is_shorter_where_returns_are_denser_and_longer_where_they_are_sparse(
    per_m2: float, window_s: float
) -> None:
    """Eight returns in each of the finest cells are wanted, within half and twice the parameter."""
    assert looks(per_m2)[-1].window_s == window_s


@pytest.mark.parametrize(("height_m", "window_s"), [(3.0, 1.0), (7.0, 1.0), (9.0, 2.0)])
def test_no_window_is_stretched_near_the_ground(height_m: float, window_s: float) -> None:
    """However sparse the returns: what drives under the vehicle there must be seen at once."""
    assert looks(4.0, height_m=height_m)[-1].window_s == window_s


@pytest.mark.parametrize("span_s", [0.5, 2.0])
def test_what_counts_is_the_density_per_second(span_s: float) -> None:
    """So a window that got longer is not asked to be short again for what it gathered."""
    assert looks(200 * span_s, span_s=span_s)[-1].window_s == 1.0


@pytest.mark.parametrize("window_s", [0.2, 1.0, 4.0])
@pytest.mark.parametrize("per_m2", [0.5, 30.0, 150.0, 3000.0])
@pytest.mark.parametrize("speed_ms", [0.0, 3.0, 60.0])
def test_the_window_is_between_half_and_twice_the_parameter(
    window_s: float, per_m2: float, speed_ms: float
) -> None:
    for choice in looks(per_m2, f"window_s={window_s}", speed_ms=speed_ms):
        assert window_s / 2 <= choice.window_s <= 2 * window_s


def test_the_window_is_shorter_where_it_is_flown_faster() -> None:
    chosen = [looks(20.0, speed_ms=speed)[-1].window_s for speed in (0.0, 2.0, 3.0, 4.0, 5.0, 8.0, 30.0)]
    assert chosen == sorted(chosen, reverse=True)
    assert chosen[0] == 2.0
    assert chosen[-1] == 0.5


@pytest.mark.parametrize("speed_ms", np.arange(0.5, 7.6, 0.17).tolist())
def test_in_a_window_the_vehicle_flies_no_farther_than_half_of_what_it_sees(speed_ms: float) -> None:
    """Unless half of the parameter is too long already."""
    choice = looks(20.0, n=2, speed_ms=speed_ms)[-1]
    points = field(20.0)
    reach_m = float(np.median(np.hypot(points[:, 0], points[:, 1])))
    assert choice.speed_ms * choice.window_s <= reach_m / 2
    assert choice.speed_ms * (choice.window_s + 0.25) > reach_m / 2 or choice.window_s == 2.0


# ---- resolution ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("per_m2", "height_m", "speed_ms", "level"),
    [
        (9.0, 10, 0, 0),  # cells of 0.5 m get two returns
        (2.0, 10, 0, 1),  # those of 1 m
        (0.5, 10, 0, 2),
        (0.1, 10, 0, 2),  # none coarser
        (25.0, 90, 0, 0),
        (25.0, 120, 0, 1),  # returns are placed to 0.31 m
        (25.0, 250, 0, 2),  # and to 0.65 m
        (25.0, 10, 40, 0),
        (25.0, 10, 60, 1),
        (25.0, 10, 120, 2),
        (25.0, 80, 40, 1),  # height and speed together
    ],
)
def test_the_far_cells_are_the_finest_that_are_hit_and_can_be_placed(
    per_m2: float, height_m: float, speed_ms: float, level: int
) -> None:
    assert looks(per_m2, n=5, height_m=height_m, speed_ms=speed_ms)[-1].level == level


def test_short_windows_choose_the_level_that_long_ones_would() -> None:
    levels = [choice.level for choice in looks(0.9, n=30, span_s=0.1)]
    assert levels == [COARSEST] * 15 + [0] * 15


def test_the_level_changes_when_three_windows_in_a_row_ask_for_it() -> None:
    assert [choice.level for choice in looks(9.0, n=4)] == [COARSEST, COARSEST, 0, 0]


def levels(*asked: int) -> list[int]:
    """The level after windows that ask for these."""
    dense = {0: 9.0, 1: 2.0, 2: 0.5}
    adapter = Adapter(parameters())
    out = []
    for second, level in enumerate(asked):
        points = field(dense[level])
        out.append(adapter.choose(window(points, second, (0.0, 0.0, 10.0)), points).level)
    return out


@pytest.mark.parametrize(
    ("asked", "chosen"),
    [
        ((0, 0, 2, 0, 0, 2), (2, 2, 2, 2, 2, 2)),
        ((0, 0, 0, 2, 2, 0, 2, 2, 2), (2, 2, 0, 0, 0, 0, 0, 0, 2)),
        ((0, 1, 0, 0), (2, 2, 1, 1)),  # no farther than all three ask for
        ((0, 1, 0, 0, 0), (2, 2, 1, 1, 0)),
        ((0, 0, 0, 1, 2, 1), (2, 2, 0, 0, 0, 1)),
    ],
)
def test_a_window_or_two_change_no_level(asked: tuple[int, ...], chosen: tuple[int, ...]) -> None:
    assert levels(*asked) == list(chosen)


@given(st.lists(st.integers(0, 2), min_size=1, max_size=24))
@settings(max_examples=40, deadline=None)
def test_a_new_level_is_one_that_the_last_three_windows_went_up_to(asked: list[int]) -> None:
    chosen = [COARSEST, *levels(*asked)]
    for i, (old, new) in enumerate(pairwise(chosen), start=1):
        if new != old:
            last = asked[max(0, i - 3) : i]
            assert len(last) == 3
            assert all(min(old, a) <= new <= max(old, a) and a != old for a in last)


# ---- fixed --------------------------------------------------------------------------------------


@pytest.mark.parametrize("fixed", ["adaptive=off", "mode=source"])
@pytest.mark.parametrize("per_m2", [0.5, 9.0, 900.0])
def test_switched_off_and_in_source_mode_nothing_follows(fixed: str, per_m2: float) -> None:
    for choice in looks(per_m2, fixed, "window_s=0.8", n=5, speed_ms=10.0):
        assert (choice.level, choice.window_s) == (COARSEST, 0.8)


@pytest.mark.parametrize("fixed", ["adaptive=off", "mode=source", "adaptive=on"])
def test_near_and_far_change_in_every_case(fixed: str) -> None:
    assert [choice.far for choice in looks(9.0, fixed, n=2, height_m=50.0)] == [True, True]
    assert [choice.far for choice in looks(9.0, fixed, n=2, height_m=30.0)] == [False, False]
    assert [choice.far for choice in looks(9.0, fixed, n=2, height_m=30.0, speed_ms=13.0)] == [False, True]


def test_the_same_windows_give_the_same_choices() -> None:
    rng = np.random.default_rng(8)
    clouds = [field(float(d)) + rng.normal(0, 0.05, 3) for d in rng.uniform(0.3, 300, 12)]
    seen = []
    for _ in range(2):
        adapter = Adapter(parameters())
        seen.append([adapter.choose(window(c, i, (i * 2.0, 0.0, 20.0)), c) for i, c in enumerate(clouds)])
    assert seen[0] == seen[1]
    assert len({choice.level for choice in seen[0]}) > 1 or len({c.window_s for c in seen[0]}) > 2


# ---- windows that tell little -------------------------------------------------------------------

NAN = math.nan
ODD = {
    "empty": (np.zeros((0, 3)), 1.0, (0.0, 0.0, 10.0)),
    "sensor unknown": (field(9.0), 1.0, (NAN, NAN, NAN)),
    "empty and unknown": (np.zeros((0, 3)), 1.0, (NAN, NAN, NAN)),
    "one return": (np.zeros((1, 3)), 1.0, (0.0, 0.0, 10.0)),
    "same stamp": (field(9.0), 0.0, (7.0, 0.0, 10.0)),
    "time goes back": (field(9.0), -5.0, (7.0, 0.0, 10.0)),
    "below the sensor's own height": (field(9.0), 1.0, (0.0, 0.0, -3.0)),
}


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("mode", ["default", "source"])
def test_odd_windows_are_taken_and_the_next_one_is_as_ever(odd: str, mode: str) -> None:
    pipe = Pipeline(parameters(f"mode={mode}"), (0.0, 0.0))
    pipe.process(window(field(9.0), 0.0, (0.0, 0.0, 10.0)))
    cloud, second, sensor = ODD[odd]
    report = pipe.process(window(cloud, second, sensor))
    assert report.choice.speed_ms >= 0
    assert math.isfinite(report.choice.speed_ms)
    assert math.isfinite(report.choice.density_per_m2)
    assert 0.5 <= report.choice.window_s <= 2.0
    assert report.choice.far is False
    after = pipe.process(window(field(9.0), 2.0, (0.0, 0.0, 10.0)))
    assert after.choice.height_m == 10.0
    assert after.choice.speed_ms < 8
    assert len(after.near.zones) <= 1


@pytest.mark.parametrize("odd", ODD)
def test_an_odd_window_may_be_the_first(odd: str) -> None:
    cloud, second, sensor = ODD[odd]
    report = Pipeline(parameters(), (0.0, 0.0)).process(window(cloud, second, sensor))
    assert report.choice.speed_ms == 0.0
    assert report.choice.level == COARSEST


def test_a_window_of_the_same_stamp_or_an_earlier_one_keeps_the_speed() -> None:
    adapter, points = Adapter(parameters()), field(9.0)

    def speed(second: float, east_m: float) -> float:
        return adapter.choose(window(points, second, (east_m, 0.0, 10.0)), points).speed_ms

    assert [speed(0, 0), speed(1, 4), speed(1, 5), speed(0, 6), speed(1, 7)] == [0, 4, 4, 4, 1]


def test_the_speed_over_a_window_of_unknown_place_is_the_mean_one() -> None:
    adapter, points = Adapter(parameters()), field(9.0)
    speeds = [
        adapter.choose(window(points, second, (east, 0.0, 10.0)), points).speed_ms
        for second, east in enumerate((0.0, 4.0, NAN, 14.0))
    ]
    assert speeds == [0, 4, 4, 5]


def test_snapshots_are_as_dense_as_the_time_from_one_to_the_next_tells() -> None:
    """All returns of a flash LiDAR's frame have one stamp."""
    adapter, points = Adapter(parameters()), field(2.0)
    choices = [adapter.choose(window(points, 0.2 * k, (0.0, 0.0, 10.0), 0.0), points) for k in range(20)]
    assert choices[0].density_per_m2 == pytest.approx(2.0, rel=0.05)
    assert choices[-1].density_per_m2 == pytest.approx(10.0, rel=0.05)
    assert (choices[0].level, choices[-1].level) == (COARSEST, 0)


def test_returns_kilometres_apart_need_no_memory_for_what_is_between() -> None:
    points = np.array([[0.0, 0.0, 0.0], [4e7, 4e7, 0.0]])
    choice = Adapter(parameters()).choose(window(points, 0.0, (0.0, 0.0, 10.0)), points)
    assert (choice.density_per_m2, choice.level) == (0.0, COARSEST)


# ---- through the pipeline -----------------------------------------------------------------------


def fly(pipe: Pipeline, per_m2: float, first: int, n: int) -> list[Report]:
    cloud = field(per_m2, 28.0)
    return [pipe.process(window(cloud, second, (0.0, 0.0, 10.0))) for second in range(first, first + n)]


def test_zones_of_the_far_map_keep_their_ids_over_a_change_of_level() -> None:
    pipe = Pipeline(parameters("max_age_s=4", "hold_s=4", "angle_noise_deg=0"), (0.0, 0.0))
    reports = fly(pipe, 0.5, 0, 4) + fly(pipe, 16.0, 4, 4) + fly(pipe, 1.5, 8, 10)
    cells = [report.far.grid.cell_m for report in reports]
    assert cells == [2.0] * 6 + [0.5] * 4 + [1.0] * 8
    assert [report.choice.level for report in reports] == [2] * 6 + [0] * 4 + [1] * 8
    named = [tuple(zone.id for zone in report.far.zones) for report in reports]
    assert len(set(named)) == 1
    assert len(named[0]) == 1
    maps = pipe.maps(which="far")
    assert maps is not None
    assert maps.grid.cell_m == 1.0


def test_the_near_map_keeps_its_cells() -> None:
    pipe = Pipeline(parameters(), (0.0, 0.0))
    for report in fly(pipe, 0.5, 0, 4) + fly(pipe, 100.0, 4, 4):
        assert report.near.grid.cell_m == 0.2


@pytest.mark.parametrize("fixed", ["adaptive=off", "mode=source"])
def test_the_far_map_keeps_its_cells_when_nothing_follows(fixed: str) -> None:
    pipe = Pipeline(parameters(fixed), (0.0, 0.0))
    for report in fly(pipe, 16.0, 0, 5):
        assert report.far.grid.cell_m == 2.0
        assert report.choice.window_s == 1.0


def patchy(seed: int) -> Held:
    """Random cells of a zone."""
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(2, 9, 2)
    row0, col0 = rng.integers(-3, 12, 2)
    before = int(rng.integers(0, 60))  # cells that a row's first word begins to the west
    cells = np.zeros((rows, before + cols), np.uint8)
    cells[:, before:] = rng.integers(0, 2, (rows, cols))
    cells[rng.integers(rows), before + rng.integers(cols)] = 1
    box = Box(int(row0), int(row0 + rows), int(col0), int(col0 + cols))
    return Held(7, box, packed(cells), box.col0 - before)


def holds(held: Held, row: int, col: int) -> bool:
    r, c = row - held.box.row0, col - held.col0
    inside = 0 <= r < len(held.bits) and 0 <= c < 64 * held.bits.shape[1]
    return inside and bool(bit(held.bits, r, c))


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 2), st.integers(0, 2), st.integers(-5, 5), st.integers(-5, 5))
def test_in_another_grid_a_cell_belongs_to_a_zone_where_its_centre_does(
    seed: int, level: int, other: int, east: int, north: int
) -> None:
    old = Grid(-8.0, 4.0, 0.5 * 2**level, 40, 40)
    new = Grid(-8.0 + 2 * east, 4.0 + 2 * north, 0.5 * 2**other, 60, 60)
    zone = patchy(seed)
    moved = regridded(zone, old, new)
    assert len(moved.bits) == moved.box.shape[0]
    for row in range(moved.box.row0 - 5, moved.box.row1 + 5):
        for col in range(moved.box.col0 - 5, moved.box.col1 + 5):
            there = old.index(*(v + 1e-6 for v in new.centre(row, col)))
            if level < other:  # centres of wider cells lie on the corners of the finer ones
                there = old.index(*new.centre(row, col))
            assert holds(moved, row, col) == holds(zone, *there)
