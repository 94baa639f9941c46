"""Departures of docs/sources.md: the result of the sources' rules and of default mode in each danger."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN, UNSAFE, Pipeline, Report
from tests.unit.slz.hand_made import NOWHERE, at, flat, fly, maps, returns, state_at, window

Floats = NDArray[np.float64]
ABOVE = (0.0, 0.0, 30.0)
HALF_M = 12.0


def pipeline(mode: str, *own: str) -> Pipeline:
    """One pipeline of cells of 1 m; the histogram is off but where a test is about it."""
    fixed = [
        "zone_m=100",
        "cell_m=1",
        "footprint_m=3",
        "coverage_m=2",
        "safe_slope_deg=4",
        "angle_noise_deg=0",
    ]
    fixed += [f"mode={mode}", "min_square_m=3", "min_boundary_points=5", "histogram_threshold=1"]
    return Pipeline(params.load("quadcopter", [*fixed, *own]), (0.0, 0.0))


def both(*own: str) -> tuple[Pipeline, Pipeline]:
    return pipeline("source", *own), pipeline("default", *own)


def field(seed: int, density: float = 30.0, slope_deg: float = 0.0, noise_m: float = 0.02) -> Floats:
    """Noisy ground that rises to the east."""
    rng = np.random.default_rng(seed)
    n = round(density * (2 * HALF_M) ** 2)
    xy = rng.uniform(-HALF_M, HALF_M, (n, 2))
    return np.column_stack([xy, np.tan(np.radians(slope_deg)) * xy[:, 0] + rng.normal(0, noise_m, n)])


def in_flight(pipe: Pipeline, *clouds: Floats) -> Report:
    """Windows of a sensor 30 m above the middle, one a second."""
    return [pipe.process(window(cloud, i, ABOVE)) for i, cloud in enumerate(clouds)][-1]


# ---- only slopes below the maximum are written --------------------------------------------------


def walled(up_m: float = 3.0) -> Floats:
    """A wall one cell thick across the middle of 30 x 30 cells; to the north of row 15."""
    height = flat(30, 30)
    height[15] = up_m
    return height


def test_a_wall_that_appears_later_stays_safe_by_the_source_and_is_unsafe_by_default() -> None:
    source, default = both()
    for pipe in (source, default):
        fly(pipe, returns(flat(30, 30), 1.0), returns(walled(), 1.0))
    for north in (14.5, 15.5, 16.5):
        assert state_at(source, 15.5, north) == SAFE
        assert state_at(default, 15.5, north) == UNSAFE


def test_ground_beside_a_wall_seen_from_the_first_is_safe_by_neither() -> None:
    """So it is the order that makes the source's wall safe."""
    for pipe in both():
        fly(pipe, returns(walled(), 1.0))
        assert state_at(pipe, 15.5, 14.5) != SAFE


# ---- RR = 1: the new zone is ignored ------------------------------------------------------------


@pytest.mark.parametrize(("row", "lost"), [(37, 0.05), (20, 0.4)])
def test_a_zone_that_shrank_keeps_its_size_by_the_source_and_loses_it_by_default(
    row: int, lost: float
) -> None:
    """A kerb of 0.4 m across 40 x 40 cells, with rubble behind it, north of a row."""
    kerb = flat(40, 40)
    kerb[row:] = 0.4
    kerb[row + 1 :: 2, ::2] = 1.5
    dry = both("water_suspicion=1")  # dead level with a bank, it may be a pond
    for pipe, shrinks in zip(dry, (False, True), strict=True):
        before = fly(pipe, returns(flat(40, 40), 1.0)).zones[0]
        after = fly(pipe, returns(kerb, 1.0))
        beyond = after.grid.index(20.5, row + 0.5)
        assert state_at(pipe, 20.5, row + 0.5) == UNSAFE
        (zone,) = after.zones
        assert zone.id == before.id
        assert zone.holds(*beyond) is not shrinks
        if shrinks:
            assert zone.area_m2 < (1 - lost) * before.area_m2
        else:
            assert zone.area_m2 == before.area_m2


# ---- a cell's value is the mean height ----------------------------------------------------------


def test_a_pole_inside_a_cell_vanishes_in_the_source_s_mean_and_is_unsafe_by_default() -> None:
    pole = np.column_stack([np.full(4, 2.5), np.full(4, 2.5), np.linspace(0.5, 2.0, 4)])
    cloud = np.vstack([field(0, density=150), pole])
    source, default = both()
    in_flight(source, cloud)
    in_flight(default, cloud)
    assert at(source, "height_m", 2.5, 2.5) < 0.1
    assert (state_at(source, 2.5, 2.5), state_at(default, 2.5, 2.5)) == (SAFE, UNSAFE)
    assert (state_at(source, 1.5, 2.5), state_at(default, 1.5, 2.5)) == (SAFE, UNSAFE)


# ---- mean of old and new ------------------------------------------------------------------------


@pytest.mark.parametrize("hold_s", [60.0, 3.0])
def test_the_last_window_weighs_half_by_the_source_and_its_share_by_default(hold_s: float) -> None:
    """Five windows, one a second; the last begins a new epoch, or not."""
    level = [returns(flat(20, 20), 1.0)] * 4
    high = returns(flat(20, 20) + 0.2, 1.0)
    source, default = both(f"hold_s={hold_s}")
    for pipe, expected in ((source, 0.2 / 2), (default, 0.2 / 5)):
        fly(pipe, *level, high)
        assert at(pipe, "height_m", 10.5, 10.5) == pytest.approx(expected, abs=1e-5)


def test_noise_stays_in_the_source_s_mean_and_averages_out_by_default() -> None:
    """Twenty windows of 5 cm noise, one return a cell: the source's mean keeps 5 cm / sqrt(3)."""
    rng = np.random.default_rng(2)
    clouds = [returns(rng.normal(0, 0.05, (40, 40)), 1.0) for _ in range(20)]
    source, default = both("hold_s=60", "worst_slope_deg=89")
    for pipe, expected in ((source, 0.05 / np.sqrt(3)), (default, 0.05 / np.sqrt(20))):
        fly(pipe, *clouds)
        spread = float(np.std(maps(pipe).height_m[2:-2, 2:-2]))
        assert spread == pytest.approx(expected, rel=0.1)


def test_old_observations_give_way_to_two_epochs_of_newer_ones_by_default() -> None:
    low, high = returns(flat(20, 20), 1.0), returns(flat(20, 20) + 0.2, 1.0)
    default = pipeline("default", "hold_s=3")
    fly(default, *[low] * 3, *[high] * 9)
    assert at(default, "height_m", 10.5, 10.5) == pytest.approx(0.2, abs=1e-5)


# ---- slope from the four neighbours -------------------------------------------------------------


def test_noise_makes_flat_ground_steep_by_the_source_s_gradient_and_not_by_the_plane_fit() -> None:
    """20 returns a square metre, 2 cm of noise, cells of 0.2 m."""
    cloud = field(3, density=20)
    source, default = both("cell_m=0.2", "footprint_m=2", "coverage_m=1")
    in_flight(source, cloud)
    in_flight(default, cloud)
    gradient, plane = (m.slope_deg[np.isfinite(m.slope_deg)] for m in (maps(source), maps(default)))
    assert np.sqrt(np.mean(gradient**2)) > 4
    assert (gradient >= 4).mean() > 0.4
    assert np.sqrt(np.mean(plane**2)) < 0.4
    assert not (maps(default).state == UNSAFE).any()
    assert (maps(default).state == SAFE).mean() > 0.7


def test_standard_errors_of_the_slope_are_kept_from_its_limit_by_default() -> None:
    """The same ground just below the limit is safe where many returns fix its slope, and else not."""
    shares = []
    for density in (4.0, 200.0):
        pipe = pipeline("default", "safe_slope_deg=4", "gear=none")
        fly(pipe, field(4, density, slope_deg=3.5, noise_m=0.05))
        inner = maps(pipe).state[5:-5, 5:-5]
        shares.append(float((inner == SAFE).mean()))
    assert shares[0] < 0.1
    assert shares[1] > 0.95


# ---- no elevation between returns counts as nothing ---------------------------------------------


def test_a_pond_belongs_to_the_zone_by_the_source_and_keeps_its_shore_unknown_by_default() -> None:
    height = flat(40, 40)
    height[17:23, 17:23] = np.nan
    source, default = both()
    for pipe, held in ((source, True), (default, False)):
        report = fly(pipe, returns(height, 1.0))
        (zone,) = report.zones
        assert zone.holds(*report.grid.index(20.5, 20.5)) is held
        assert state_at(pipe, 20.5, 20.5) == UNKNOWN
    assert state_at(source, 15.5, 20.5) == SAFE  # a footprint of 3 m there ends at 17, half a metre from it
    assert state_at(default, 15.5, 20.5) == UNKNOWN
    assert state_at(default, 13.5, 20.5) == SAFE


@pytest.mark.parametrize(("gap", "safe"), [(1, True), (2, True), (3, False)])
def test_a_gap_narrower_than_the_coverage_counts_as_seen_by_default_only(gap: int, safe: bool) -> None:
    height = flat(30, 30)
    height[:, 15 : 15 + gap] = np.nan
    source, default = both("coverage_m=3", "footprint_m=5")
    for pipe in (source, default):
        fly(pipe, returns(height, 1.0))
    assert state_at(source, 15.5, 15.5) == UNKNOWN
    assert state_at(default, 15.5, 15.5) == (SAFE if safe else UNKNOWN)


@pytest.mark.parametrize(("up_m", "seen"), [(0.0, True), (0.6, False)])
def test_a_gap_that_only_an_object_closes_is_unknown_by_default(up_m: float, seen: bool) -> None:
    """In the middle of a gap of 3 m either a strip of ground, or a beam above it."""
    height = flat(30, 30)
    height[:, 14:17] = np.nan
    height[:, 15] = up_m
    default = pipeline("default", "coverage_m=3", "footprint_m=5")
    fly(default, returns(height, 1.0))
    assert [state_at(default, east + 0.5, 15.5) == SAFE for east in range(12, 19)] == [seen] * 7
    assert state_at(default, 10.5, 15.5) == SAFE


def test_the_outermost_seen_cells_are_safe_ground_by_the_source_and_none_by_default() -> None:
    source, default = both("footprint_m=1")
    for pipe in (source, default):
        fly(pipe, returns(flat(20, 20), 1.0))
    assert (state_at(source, 18.5, 10.5), state_at(default, 18.5, 10.5)) == (SAFE, UNKNOWN)
    assert state_at(default, 17.5, 10.5) == SAFE


# ---- every return is believed, or dropped by its height alone -----------------------------------


def test_a_speck_of_dust_condemns_ground_by_the_source_and_not_by_default() -> None:
    """On a gentle slope, where the ground elsewhere is as high as the speck is."""
    speck = [[-8.25, 0.25, 0.3]]
    cloud = np.vstack([field(5, slope_deg=2), speck])
    source, default = both("cell_m=0.5", "histogram_threshold=0.9")
    in_flight(source, cloud)
    in_flight(default, cloud)
    around = [(-8.75, 0.25), (-7.75, 0.25), (-8.25, -0.25), (-8.25, 0.75)]
    assert any(state_at(source, *place) == UNSAFE for place in around)
    assert all(state_at(default, *place) == SAFE for place in [*around, (-8.25, 0.25)])


def test_returns_few_for_their_range_are_dust_by_default_and_believed_by_the_source() -> None:
    """Eight returns within 0.2 m: an object near the sensor would send back dozens; far off eight do."""
    rng = np.random.default_rng(14)
    specks = np.array([0.5, 0.5, 2.2]) + rng.uniform(-0.1, 0.1, (8, 3))
    cloud = np.vstack([field(14, density=90), specks])
    for sensor_m, seen in ((3.0, SAFE), (30.0, UNSAFE)):
        source, default = both()
        for pipe in (source, default):
            pipe.process(window(cloud, 0.0, (0.0, 0.0, sensor_m)))
        assert state_at(default, 0.5, 0.5) == seen
        assert state_at(source, 1.5, 0.5) == UNSAFE


def wire() -> Floats:
    """20 returns of a sagging wire along 10 m, 2.5 to 3 m above the ground."""
    east = np.linspace(-5, 5, 20)
    return np.column_stack([east, np.full(20, 3.25), 2.5 + 0.02 * east**2])


def test_a_wire_is_dropped_by_its_height_by_the_source_and_is_unsafe_by_default() -> None:
    cloud = np.vstack([field(6), wire()])
    source, default = both("cell_m=0.5", "histogram_threshold=0.9")
    dropped = in_flight(source, cloud)
    in_flight(default, cloud)
    assert dropped.n_points - dropped.n_used >= 20
    for east in (-3.25, 0.25, 3.25):
        assert (state_at(source, east, 3.25), state_at(default, east, 3.25)) == (SAFE, UNSAFE)


# ---- windows are laid over each other as navigation places them ---------------------------------


def test_drift_makes_a_step_on_flat_ground_by_the_source_and_none_by_default() -> None:
    """The first window sees the west, the second, placed 0.4 m too high, the east; 8 m are in both."""
    first, second = field(7), field(8) + np.array([0.0, 0.0, 0.4])
    clouds = first[first[:, 0] < 4], second[second[:, 0] > -4]
    source, default = both()
    loose = pipeline("default", "register_m=0")
    steps = []
    for pipe in (source, default, loose):
        in_flight(pipe, *clouds)
        steps.append(abs(at(pipe, "height_m", 8.5, 0.5) - at(pipe, "height_m", -8.5, 0.5)))
    assert steps[0] == pytest.approx(0.4, abs=0.02)
    assert steps[1] < 0.02
    assert steps[2] == pytest.approx(0.4, abs=0.02)
    assert state_at(default, 0.5, 0.5) == SAFE
    assert state_at(loose, 0.5, 0.5) == UNSAFE


# ---- everything inside a contour belongs to the zone and is skipped -----------------------------


def test_a_court_in_a_ring_of_safe_ground_is_no_zone_by_the_source_and_one_by_default() -> None:
    height = flat(40, 40)
    height[12:28, 12:28] = 3.0
    height[14:26, 14:26] = 0.0
    source, default = both()
    counts = []
    for pipe in (source, default):
        report = fly(pipe, returns(height, 1.0))
        court, wall = report.grid.index(20.5, 20.5), report.grid.index(13.5, 20.5)
        own = [zone for zone in report.zones if zone.holds(*court) and not zone.holds(*wall)]
        counts.append((len(report.zones), len(own)))
        assert state_at(pipe, 20.5, 20.5) == SAFE
    assert counts == [(1, 0), (2, 1)]


def test_a_hole_in_a_zone_is_part_of_it_by_the_source_and_stays_a_hole_by_default() -> None:
    height = flat(40, 40)
    height[19:22, 19:22] = 0.4
    for pipe, held in zip(both(), (True, False), strict=True):
        report = fly(pipe, returns(height, 1.0))
        (zone,) = report.zones
        assert state_at(pipe, 20.5, 18.5) == UNSAFE
        assert zone.holds(*report.grid.index(20.5, 18.5)) is held


# ---- seen once, safe for ever -------------------------------------------------------------------


def test_ground_not_seen_for_long_is_safe_by_the_source_and_unknown_by_default() -> None:
    source, default = both("max_age_s=300")
    for pipe in (source, default):
        fly(pipe, returns(flat(20, 20), 1.0))
        fly(pipe, returns(flat(20, 20), 1.0, -30.0, -30.0), first_s=200.0)
        assert state_at(pipe, 10.5, 10.5) == SAFE
        fly(pipe, returns(flat(20, 20), 1.0, -30.0, -30.0), first_s=400.0)
    assert (state_at(source, 10.5, 10.5), state_at(default, 10.5, 10.5)) == (SAFE, UNKNOWN)
    assert state_at(default, -20.5, -20.5) == SAFE


# ---- the histogram trims sparse end bins --------------------------------------------------------


def test_the_roof_of_a_tall_building_is_dropped_by_the_source_and_mapped_by_default() -> None:
    """A pitched roof 18 to 24 m up that sent back 1 in 100 returns, and no wall in sight."""
    rng = np.random.default_rng(9)
    east, north = rng.uniform(4, 8, 170), rng.uniform(-3, 3, 170)
    roof = np.column_stack([east, north, 18 + 1.5 * (east - 4)])
    ground = field(9)
    hidden = (np.abs(ground[:, 0] - 6) < 2) & (np.abs(ground[:, 1]) < 3)
    cloud = np.vstack([ground[~hidden], roof])
    source, default = both("histogram_threshold=0.9")
    for pipe in (source, default):
        fly(pipe, cloud)
    assert np.isnan(at(source, "height_m", 6.5, 0.5))
    assert at(default, "height_m", 6.5, 0.5) == pytest.approx(18 + 1.5 * 2.5, abs=0.5)
    assert (state_at(source, 6.5, 0.5), state_at(default, 6.5, 0.5)) == (UNKNOWN, UNSAFE)


def test_a_few_returns_beyond_an_empty_gap_are_dropped_in_both_modes() -> None:
    for height_m in (40.0, -40.0):
        cloud = np.vstack([field(10), [[0.5, 0.5, height_m]]])
        for pipe in both("histogram_threshold=0.9"):
            fly(pipe, cloud)
            assert state_at(pipe, 0.5, 0.5) == SAFE
            assert abs(at(pipe, "height_m", 0.5, 0.5)) < 0.05


# ---- gaps and misprints -------------------------------------------------------------------------


@pytest.mark.parametrize("turn", ["east", "north"])
@pytest.mark.parametrize(("slope_deg", "state"), [(3.5, SAFE), (4.5, UNSAFE)])
def test_source_ground_below_the_slope_limit_is_safe_whichever_way_it_slopes(
    turn: str, slope_deg: float, state: int
) -> None:
    """Eq. 8 as printed would see no slope to the north; 3.2.4 as printed would call the steeper one safe."""
    along = np.tan(np.radians(slope_deg)) * np.arange(20.0)
    height = np.tile(along, (20, 1)) if turn == "east" else np.tile(along[:, None], (1, 20))
    pipe = pipeline("source")
    fly(pipe, returns(height, 1.0))
    assert at(pipe, "slope_deg", 10.5, 10.5) == pytest.approx(slope_deg, abs=1e-3)
    assert state_at(pipe, 10.5, 10.5) == state


@pytest.mark.parametrize("up_m", [30.0, -30.0])
@pytest.mark.parametrize(("lone", "kept"), [(1, False), (2, True)])
def test_source_an_end_bin_goes_while_it_holds_less_than_a_tenth_of_the_mean_bin(
    up_m: float, lone: int, kept: bool
) -> None:
    """Of 6000 returns in 300 bins the mean bin holds 20, a tenth of it 2; above counts as below."""
    n = 6000
    rng = np.random.default_rng(11)
    points = np.column_stack([rng.uniform(-10, 10, (n, 2)), np.zeros(n)])
    points[:lone, 2] = up_m
    report = fly(pipeline("source", "histogram_threshold=0.9"), points)
    assert report.n_used == (n if kept else n - lone)


def test_source_nine_tenths_of_the_returns_stay_however_sparse_the_ends_are() -> None:
    rng = np.random.default_rng(12)
    tail = np.linspace(1.0, 300.0, 290)
    points = np.column_stack([rng.uniform(-10, 10, (3000, 2)), np.zeros(3000)])
    points[:290, 2] = tail
    report = fly(pipeline("source", "histogram_threshold=0.9"), points)
    assert 0.9 * 3000 <= report.n_used <= 3000


def test_source_a_cell_without_a_return_has_no_slope_though_its_neighbours_have_heights() -> None:
    height = flat(20, 20)
    height[10, 10] = np.nan
    pipe = pipeline("source")
    fly(pipe, returns(height, 1.0))
    assert np.isnan(at(pipe, "slope_deg", 10.5, 10.5))
    assert state_at(pipe, 10.5, 10.5) == UNKNOWN
    assert state_at(pipe, 11.5, 11.5) == SAFE


def test_source_the_tracing_goes_on_through_a_neck_where_it_began() -> None:
    """Two fields joined by a V one cell wide, whose tip is the first cell of the raster: one zone of both."""
    safe = np.zeros((24, 40), bool)
    for step in range(10):
        safe[1 + step, [20 - step, 20 + step]] = True
    safe[11:20, 2:12] = safe[11:20, 29:39] = True
    seen = safe.copy()  # a safe cell needs its own height and those of its four neighbours
    for move, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1)):
        seen |= np.roll(safe, move, axis)
    pipe = pipeline("source")
    report = fly(pipe, returns(np.where(seen, 0.0, np.nan), 1.0))
    (zone,) = report.zones
    assert tuple(zone.boundary_cells[0]) == report.grid.index(20.5, 1.5)
    assert zone.n_safe == (maps(pipe).state == SAFE).sum()
    assert zone.holds(*report.grid.index(6.5, 15.5))
    assert zone.holds(*report.grid.index(34.5, 15.5))


def test_source_a_stored_cloud_is_treated_as_one_in_flight() -> None:
    """The sources ask nowhere where the sensor was."""
    cloud = np.vstack([field(13), wire()])
    stored, flown = pipeline("source"), pipeline("source")
    stored.process(window(cloud, 0.0, NOWHERE))
    flown.process(window(cloud, 0.0, ABOVE))
    np.testing.assert_array_equal(maps(stored).state, maps(flown).state)
