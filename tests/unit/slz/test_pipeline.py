"""Pipeline on ground with known results."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import (
    SAFE,
    UNKNOWN,
    UNSAFE,
    LocalFrame,
    Pipeline,
    PointState,
    Report,
    SurfaceKind,
    TerrainMaps,
    Window,
)

FRAME = LocalFrame(47.0, 8.0, 400.0)
HALF_M = 12.0


def ground(
    seed: int = 0, slope_deg: float = 0.0, density: float = 30.0, noise_m: float = 0.02
) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    n = round(density * (2 * HALF_M) ** 2)
    xy = rng.uniform(-HALF_M, HALF_M, (n, 2))
    z = np.tan(np.radians(slope_deg)) * xy[:, 0] + rng.normal(0, noise_m, n)
    return np.column_stack([xy, z])


def block(
    east: float, north: float, side: float, height: float, n: int = 40, seed: int = 1
) -> NDArray[np.float64]:
    """Returns from the top of something."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-side / 2, side / 2, (n, 2)) + np.array([east, north])
    return np.column_stack([xy, np.full(n, height)])


def hover(
    height_m: float,
    post_m: float = 0.0,
    seed: int = 0,
    noise_m: float = 0.02,
    angle_deg: float = 0.0,
    n: int = 150_000,
) -> NDArray[np.float64]:
    """Returns of one second below a sensor over flat ground; a post of 5 x 10 cm may stand at (1, 0.5)."""
    rng = np.random.default_rng(seed)
    down = rng.uniform(np.sin(np.radians(15)), 1, n)
    azimuth = rng.uniform(0, 2 * np.pi, n)
    across = np.sqrt(1 - down**2)
    ray = np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), -down])
    reach = height_m / down
    at_top = ray * ((height_m - post_m) / down)[:, None]
    hit = (np.abs(at_top[:, 0] - 1.0) < 0.025) & (np.abs(at_top[:, 1] - 0.5) < 0.05) & (post_m > 0)
    reach[hit] = (height_m - post_m) / down[hit]
    turn = np.radians(angle_deg) * rng.standard_normal((n, 3))  # of every axis
    points = (ray + np.cross(turn, ray)) * (reach + rng.normal(0, noise_m, n))[:, None]
    return points + np.array([0.0, 0.0, height_m])


def window(points: NDArray[np.float64], second: float = 0.0, sensor_m: float = 30.0) -> Window:
    stamps = (second * 1e9 + np.linspace(0, 0.9e9, len(points))).astype(np.int64)
    start, end = round(second * 1e9), round((second + 0.9) * 1e9)
    points, sensor = np.ascontiguousarray(points), np.array([0.0, 0.0, sensor_m])
    for array in (points, stamps, sensor):
        array.setflags(write=False)  # as the fusion hands them over
    return Window(points, stamps, sensor, FRAME, start, end)


def pipeline(*settings: str) -> Pipeline:
    own = ["zone_m=40", "angle_noise_deg=0", "min_boundary_points=10", *settings]
    return Pipeline(params.load("quadcopter", own), (0.0, 0.0))


def run(pipe: Pipeline, *clouds: NDArray[np.float64]) -> Report:
    report = None
    for second, cloud in enumerate(clouds):
        report = pipe.process(window(cloud, second))
    assert report is not None
    return report


def maps(pipe: Pipeline) -> TerrainMaps:
    found = pipe.maps()
    assert found is not None
    return found


def state_at(pipe: Pipeline, east: float, north: float) -> int:
    m = maps(pipe)
    row, col = m.grid.index(east, north)
    return int(m.state[row - m.box.row0, col - m.box.col0])


def test_flat_noisy_ground_is_one_zone_with_room() -> None:
    report = run(pipeline(), ground())
    assert len(report.zones) == 1
    zone = report.zones[0]
    assert zone.area_m2 > 0.75 * (2 * HALF_M) ** 2
    assert zone.best.clearance_m > 8
    assert np.hypot(*zone.best.enu_m[:2]) < 3
    assert zone.best.certainty > 0.99


@pytest.mark.parametrize(("slope", "safe"), [(5.0, True), (8.0, True), (12.0, False), (30.0, False)])
def test_slope_decides_at_footprint_scale(slope: float, safe: bool) -> None:
    pipe = pipeline()
    report = run(pipe, ground(slope_deg=slope))
    assert bool(report.zones) is safe
    m = maps(pipe)
    inner = m.slope_deg[np.isfinite(m.slope_deg)]
    assert np.sqrt(np.mean((inner - slope) ** 2)) < 0.35


def test_a_pole_among_many_ground_returns_is_seen() -> None:
    pipe = pipeline()
    pole = np.column_stack([np.full(8, 2.05), np.full(8, 1.05), np.linspace(0.2, 3.0, 8)])
    run(pipe, np.vstack([ground(density=100), pole]))
    assert state_at(pipe, 2.05, 1.05) == UNSAFE
    assert state_at(pipe, 2.9, 1.05) == UNSAFE
    assert state_at(pipe, 4.0, 1.05) == SAFE


@pytest.mark.parametrize("height", [12.0, 3.0, -6.0])
def test_a_lone_ghost_condemns_nothing(height: float) -> None:
    pipe = pipeline()
    run(pipe, np.vstack([ground(), [[2.05, 1.05, height]]]))
    assert state_at(pipe, 2.05, 1.05) == SAFE


@pytest.mark.parametrize(
    ("place", "count"),
    [((0.4, 0.2, 2.2), 8), ((1.0, 0.5, 0.4), 2), ((1.0, 0.5, -0.3), 2), ((-1.0, 0.3, -1.5), 1)],
)
def test_dust_at_the_sensor_and_echoes_below_the_ground_condemn_nothing(
    place: tuple[float, float, float], count: int
) -> None:
    pipe = pipeline("angle_noise_deg=0.15")
    rng = np.random.default_rng(3)
    for second in range(4):
        specks = np.array(place) + rng.uniform(-0.1, 0.1, (count, 3))
        pipe.process(window(np.vstack([hover(3.0, seed=second), specks]), second, 3.0))
        assert state_at(pipe, *place[:2]) == SAFE


def test_a_lone_return_of_a_wire_in_a_sparse_stored_cloud_is_unsafe() -> None:
    cloud = np.vstack([ground(density=3), [[2.05, 1.05, 2.5]]])
    stamps = np.zeros(len(cloud), np.int64)
    pipe = pipeline("cell_m=0.5", "coverage_m=2.5")
    pipe.process(Window(cloud, stamps, np.full(3, np.nan), FRAME, 0, 0))
    assert state_at(pipe, 2.05, 1.05) == UNSAFE
    assert state_at(pipe, -6, -6) == SAFE


def test_two_echoes_in_neighbouring_cells_of_many_returns_are_chance() -> None:
    pipe = pipeline("angle_noise_deg=0.15")
    for second, east in enumerate((0.9, 1.1)):
        cloud = np.vstack([hover(6.0, seed=second, n=200_000), [[east, 0.5, 0.5]]])
        pipe.process(window(cloud, second, 6.0))
    assert state_at(pipe, 1.0, 0.5) == SAFE


def test_echoes_close_below_the_ground_that_are_apart_are_chance_and_those_at_one_place_a_hole() -> None:
    for apart_m, state in ((0.3, SAFE), (0.03, UNSAFE)):
        pipe = pipeline("angle_noise_deg=0.15")
        for second, depth in enumerate((0.34, 0.46, 0.5)):
            cloud = np.vstack([hover(8.0, seed=second), [[1.0 + apart_m * (second - 1), 0.5, -depth]]])
            pipe.process(window(cloud, second, 8.0))
        assert state_at(pipe, 1.0, 0.5) == state


def test_a_hole_of_0_3_by_0_3_m_is_unsafe() -> None:
    pipe = pipeline("angle_noise_deg=0.15")
    for second in range(3):
        cloud = hover(8.0, seed=second)
        cloud[(np.abs(cloud[:, 0] - 1) < 0.15) & (np.abs(cloud[:, 1] - 0.5) < 0.15), 2] -= 0.4
        pipe.process(window(cloud, second, 8.0))
    assert state_at(pipe, 1.0, 0.5) == UNSAFE


@pytest.mark.parametrize("sensor_m", [2.0, 5.0, 12.0])
def test_a_post_of_5_by_10_cm_and_a_hand_s_height_more_than_the_limit_is_unsafe(sensor_m: float) -> None:
    pipe = pipeline("angle_noise_deg=0.15")
    for second in range(5):
        pipe.process(window(hover(sensor_m, 0.4, second, angle_deg=0.15), second, sensor_m))
    assert state_at(pipe, 1.0, 0.5) == UNSAFE


@pytest.mark.parametrize("sensor_m", [3.0, 10.0, 30.0])
def test_noise_alone_does_not_fill_the_relief_limit(sensor_m: float) -> None:
    pipe = pipeline("angle_noise_deg=0.15")
    for second in range(12):
        pipe.process(window(hover(sensor_m, seed=second, angle_deg=0.15), second, sensor_m))
    m = maps(pipe)
    assert not (m.state == UNSAFE).any()
    assert np.nanmax(m.relief_m) < 0.25


def test_a_car_that_arrives_is_unsafe_at_once_and_shrinks_the_zone() -> None:
    pipe = pipeline()
    before = run(pipe, ground(), ground(1))
    after = pipe.process(window(np.vstack([ground(2), block(1, 1, 3, 1.5)]), 2))
    assert state_at(pipe, 1, 1) == UNSAFE
    assert after.zones[0].id == before.zones[0].id
    assert after.zones[0].area_m2 < before.zones[0].area_m2 - 9
    assert any(abs(o.height_m - 1.5) < 0.2 for o in after.zones[0].obstacles)


def test_a_car_that_left_is_forgotten_only_after_the_hold_time() -> None:
    pipe = pipeline("hold_s=5")
    pipe.process(window(np.vstack([ground(), block(1, 1, 3, 1.5)]), 0))
    for second in range(1, 5):
        pipe.process(window(ground(second), second))
    assert state_at(pipe, 1, 1) == UNSAFE
    for second in range(5, 16):
        pipe.process(window(ground(second), second))
    assert state_at(pipe, 1, 1) == SAFE


def test_ground_not_seen_is_never_safe() -> None:
    cloud = ground(density=60)
    pond = np.hypot(cloud[:, 0] - 3, cloud[:, 1]) < 2.5
    pipe = pipeline()
    run(pipe, cloud[~pond])
    for east in (3.0, 1.5, 5.2):
        assert state_at(pipe, east, 0.0) == UNKNOWN
    assert state_at(pipe, -4.0, 0.0) == SAFE


def test_the_shore_of_water_that_returns_nothing_keeps_its_distance() -> None:
    cloud = ground(density=200)
    pipe = pipeline()
    run(pipe, cloud[cloud[:, 0] < 3.05])  # in the middle of a cell
    assert state_at(pipe, 2.15, 0.0) != SAFE  # its footprint of 2 m reaches 3.1
    assert state_at(pipe, 1.65, 0.0) == SAFE


@pytest.mark.parametrize("seed", range(5))
def test_of_a_slope_at_the_limit_one_cell_in_a_hundred_is_called_safe_at_most(seed: int) -> None:
    pipe = pipeline()
    run(pipe, ground(seed, slope_deg=10.0, density=60))
    m = maps(pipe)
    assert (m.state == SAFE).sum() < 0.01 * (m.state != UNKNOWN).sum()


@pytest.mark.parametrize("slope", [0.0, 5.0, 10.0, 15.0, 20.0])
def test_the_standard_error_of_the_slope_is_honest(slope: float) -> None:
    errors, squares = [], []
    for seed in range(3):
        pipe = pipeline("safe_slope_deg=30")
        run(pipe, ground(seed, slope_deg=slope, density=20))
        m = maps(pipe)
        sigma = m.slope_sigma_deg
        known = np.isfinite(m.slope_deg)
        error = m.slope_deg[known] - slope
        squares.append(error**2)
        errors.append(error / sigma[known])
    assert np.sqrt(np.mean(np.concatenate(squares))) < 0.35
    if slope:  # on flat ground the gradient's length has a mean of its own
        assert 0.85 < np.std(np.concatenate(errors)) < 1.2


def test_evidence_ages() -> None:
    pipe = pipeline("max_age_s=10")
    run(pipe, ground())
    pipe.process(window(ground()[:200] * [0.1, 0.1, 1] + [-9, -9, 0], 30))
    assert state_at(pipe, 5, 5) == UNKNOWN


def test_ground_ages_beside_what_is_still_seen_of_its_tile() -> None:
    pipe, cloud = pipeline("max_age_s=10"), ground(density=40)
    run(pipe, cloud[(cloud[:, :2] > -7).all(axis=1) & (cloud[:, :2] < 5.5).all(axis=1)])
    corner = cloud[:400] * [0.05, 0.05, 1] + [4, 4, 0]
    for second in range(1, 15):
        pipe.process(window(corner, second))
    assert state_at(pipe, -3, -3) == UNKNOWN


def test_the_order_of_points_changes_nothing() -> None:
    cloud = np.vstack([ground(), block(1, 1, 2, 1.0)])
    first, second = pipeline(), pipeline()
    run(first, cloud)
    run(second, np.random.default_rng(5).permutation(cloud))
    np.testing.assert_array_equal(maps(first).state, maps(second).state)


def test_shifting_the_world_by_whole_cells_shifts_the_answer() -> None:
    cloud = np.vstack([ground(), block(1, 1, 2, 1.0)])
    first, second = pipeline(), pipeline()
    one, two = run(first, cloud), run(second, cloud + np.array([1.0, -0.6, 7.0]))
    assert one.zones[0].area_m2 == pytest.approx(two.zones[0].area_m2, rel=0.01)
    np.testing.assert_allclose(two.zones[0].best.enu_m - one.zones[0].best.enu_m, [1.0, -0.6, 7.0], atol=0.45)


@pytest.mark.parametrize("seed", range(5))
def test_adding_an_obstacle_never_makes_a_cell_safer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cloud = ground(seed)
    without, with_it = pipeline(), pipeline()
    run(without, cloud)
    east, north, side, height = rng.uniform([-8, -8, 0.4, 0.4], [8, 8, 4, 3])
    run(with_it, np.vstack([cloud, block(east, north, side, height, seed=seed)]))
    worse = (maps(without).state != SAFE) & (maps(with_it).state == SAFE)
    assert not worse.any()


def test_every_cell_of_a_zone_is_safe_and_zones_are_apart() -> None:
    pipe = pipeline()
    report = run(
        pipe,
        np.vstack([ground(), *(block(0, y, 0.6, 1, seed=i) for i, y in enumerate(np.arange(-12, 12, 0.5)))]),
    )
    m = maps(pipe)
    owner = np.zeros((m.grid.rows, m.grid.cols), int)
    assert len(report.zones) == 2
    full = np.full(owner.shape, UNKNOWN)
    full[m.box.slices] = m.state
    for zone in report.zones:
        area = owner[zone.box.slices]
        assert not area[zone.cells == 1].any()
        area[zone.cells == 1] = zone.id
        assert (full[zone.box.slices][zone.cells == 1] == SAFE).all()
        assert zone.holds(*m.grid.index(*zone.best.enu_m[:2]))


def test_a_watched_point_is_judged_with_every_window() -> None:
    pipe = pipeline()
    run(pipe, ground())
    pipe.select(np.array([1.0, 1.0, 0.0]))
    report = pipe.process(window(ground(1), 1))
    assert report.selected is not None
    assert report.selected.state is PointState.SAFE
    report = pipe.process(window(np.vstack([ground(2), block(1, 1, 2, 1)]), 2))
    assert report.selected is not None
    assert report.selected.state is PointState.UNSAFE


@pytest.mark.parametrize("cloud", [np.zeros((0, 3)), np.full((10, 3), np.nan), np.zeros((1, 3))])
@pytest.mark.parametrize("mode", ["default", "source"])
def test_windows_with_nothing_in_them_find_nothing(cloud: NDArray[np.float64], mode: str) -> None:
    report = pipeline(f"mode={mode}").process(window(cloud))
    assert report.zones == ()


def test_source_mode_keeps_a_zone_that_shrank_and_default_mode_does_not() -> None:
    """The source's RR = 1 rule, which is why it must be asked for."""
    before, wall = ground(density=200, noise_m=0.0), block(6, 0, 10, 2, n=3000)
    areas = {}
    for mode in ("source", "default"):
        pipe = pipeline(f"mode={mode}", "cell_m=0.5", "min_square_m=3", "safe_slope_deg=10")
        first = run(pipe, before)
        second = pipe.process(window(np.vstack([before, wall]), 1))
        areas[mode] = first.zones[0].area_m2, second.zones[0].area_m2
    assert areas["default"][1] < areas["default"][0] - 50
    assert areas["source"][1] >= areas["source"][0] - 50


def test_what_stands_in_unseen_ground_does_not_make_it_seen() -> None:
    side = np.arange(-11.95, 12, 0.1)
    cloud = np.array([(x, y, 0.01 * np.sin(37 * x + 91 * y)) for x in side for y in side])
    cloud = cloud[(np.abs(cloud[:, 0] - 0.1) > 0.5) | (np.abs(cloud[:, 1] - 0.1) > 0.5)]
    post = np.column_stack([np.full(6, 0.07), np.linspace(0.03, 0.17, 6), np.full(6, 1.5)])
    bare, posted = pipeline(), pipeline()
    run(bare, cloud)
    run(posted, np.vstack([cloud, post]))
    assert not ((maps(bare).state != SAFE) & (maps(posted).state == SAFE)).any()


def test_a_point_selected_before_the_first_window_is_judged_with_it() -> None:
    pipe = pipeline()
    pipe.select(np.array([1.0, 1.0, 0.0]))
    report = run(pipe, ground())
    assert report.selected is not None
    assert report.selected.state is PointState.SAFE


def values(report: Report, first: int) -> list[tuple[object, ...]]:
    """Return the values of all zones, with their IDs counted from the first one."""
    return [
        (zone.id - first, zone.area_m2, zone.certainty, *zone.best.enu_m.tolist(), zone.cells.tobytes())
        for zone in (*report.near.zones, *report.far.zones)
    ]


@pytest.mark.parametrize("mode", ["default", "source"])
def test_new_maps_are_those_of_a_new_pipeline_but_for_the_numbers_of_their_zones(mode: str) -> None:
    flat = [ground(seed, density=200, noise_m=0.0) for seed in (0, 1)]
    parted = flat[0][np.abs(flat[0][:, 0] - 2.0) > 1.5]
    own = f"mode={mode}", "cell_m=0.5", "min_square_m=3"
    known, fresh = pipeline(*own), pipeline(*own)
    known.select(np.array([1.0, 2.0, 0.0]))
    before = [known.process(window(cloud, second)) for second, cloud in enumerate((parted, flat[1]))]
    known.begin_new_map()
    assert known.selected is None
    assert known.maps() is None
    assert (known.state("near", before[0].zones[0].box) == UNKNOWN).all()
    for one in (known, fresh):
        one.select(np.array([-3.0, 0.0, 0.0]))
    last = max(zone.id for report in before for zone in (*report.near.zones, *report.far.zones))
    for second, cloud in enumerate((flat[1], parted), start=7):
        mine, other = (one.process(window(cloud, second)) for one in (known, fresh))
        assert values(other, 0)
        assert values(mine, last) == values(other, 0)
        assert mine.selected is not None
        assert other.selected is not None
        assert mine.selected.state is other.selected.state
        assert mine.selected.height_m == other.selected.height_m
    for layer, found in maps(known).layers.items():
        np.testing.assert_array_equal(found, maps(fresh).layers[layer])


def test_the_surface_at_a_point_is_that_of_its_cell_or_of_what_is_most_around_it() -> None:
    pipe, cloud = pipeline(), ground()
    cloud[(np.abs(cloud[:, :2]) < 3).all(axis=1), 2] += 4.0
    inside, at_the_edge = np.array([0.5, 0.5, 4.0]), np.array([2.5, 0.5, 4.0])
    assert pipe.surface_at(inside, 0.0).kind is SurfaceKind.UNKNOWN
    run(pipe, cloud)
    assert pipe.surface_at(at_the_edge, 0.0).kind is SurfaceKind.ROOF
    assert pipe.surface_at(at_the_edge).kind is SurfaceKind.BARE
    assert pipe.surface_at(inside).kind is SurfaceKind.ROOF
    assert pipe.surface_at(inside, 8.0).kind is SurfaceKind.BARE


# ---- parameters changed in flight ---------------------------------------------------------------


def sloped_and_level(seed: int) -> Window:
    """A wide field that slopes by 8 degrees, and a narrow one that is level."""
    rng = np.random.default_rng(seed)
    wide, narrow = rng.uniform(0, 40, (40_000, 2)), np.array([-45.0, 10.0]) + rng.uniform(0, 18, (10_000, 2))
    wide_up = wide[:, 0] * np.tan(np.radians(8)) + rng.normal(0, 0.02, 40_000)
    heights = np.concatenate([wide_up, rng.normal(0, 0.005, 10_000)])
    stamp_ns = (seed + 1) * 1_000_000_000
    points = np.column_stack([np.concatenate([wide, narrow]), heights])
    return Window(points, np.full(50_000, stamp_ns), np.full(3, np.nan), FRAME, stamp_ns, stamp_ns)


def test_a_certainty_asked_for_in_flight_ranks_near_and_far_zones_as_if_asked_for_at_the_start() -> None:
    lenient, strict = (params.load("quadcopter", ["zone_m=160", f"min_certainty={c}"]) for c in (0.5, 0.998))
    changed, fresh, unchanged = Pipeline(lenient), Pipeline(strict), Pipeline(lenient)
    for pipeline in (changed, fresh, unchanged):
        pipeline.process(sloped_and_level(0))
    changed.use(strict)
    after, expected, before = (p.process(sloped_and_level(1)) for p in (changed, fresh, unchanged))
    for asked, wanted, old in (
        (after.near, expected.near, before.near),
        (after.far, expected.far, before.far),
    ):
        assert [(zone.id, zone.why) for zone in asked.zones] == [(zone.id, zone.why) for zone in wanted.zones]
        assert [zone.why for zone in asked.zones] != [zone.why for zone in old.zones]


def test_a_parameter_that_shapes_the_map_is_refused_in_flight() -> None:
    pipeline = Pipeline(params.load("quadcopter"))
    with pytest.raises(ValueError, match="cell_m cannot change while a pipeline runs"):
        pipeline.use(params.load("quadcopter", ["cell_m=0.5"]))
