"""Far, high and deep returns: they count where they show a hazard."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNSAFE, LocalFrame, Pipeline, PointState, Report, Window
from slz.kernels.footprint import classify
from slz.terrain.layers import LAYERS, NAMED, Layer, Output, reaching
from tests.unit.slz.hand_made import near_map
from tests.unit.slz.test_pipeline import FRAME, block, ground, maps, pipeline, state_at

Floats = NDArray[np.float64]


def seen_from(pipe: Pipeline, cloud: Floats, sensor: Floats, second: float) -> Report:
    stamps = np.full(len(cloud), round(second * 1e9), np.int64)
    return pipe.process(
        Window(np.ascontiguousarray(cloud), stamps, sensor, FRAME, int(stamps[0]), int(stamps[0]))
    )


def with_angles() -> Pipeline:
    own = ["zone_m=120", "min_boundary_points=10", "register_m=0", "adaptive=off"]
    return Pipeline(params.load("quadcopter", own), (0.0, 0.0))


def test_a_car_seen_beyond_the_reach_makes_mapped_ground_unsafe_at_once() -> None:
    pipe = with_angles()
    seen_from(pipe, ground(), np.array([0.0, 0.0, 12.0]), 0)
    pipe.select(np.array([0.0, 0.0, 0.0]))
    beside = ground(1) + np.array([30.0, 0.0, 0.0])
    far = np.array([30.0, 0.0, 12.0])
    calm = seen_from(pipe, np.vstack([beside, ground(2)]), far, 1)
    assert calm.selected is not None
    assert calm.selected.state is PointState.SAFE
    parked = seen_from(pipe, np.vstack([beside, block(0, 0, 3, 1.5, n=60)]), far, 2)
    assert parked.selected is not None
    assert parked.selected.state is PointState.UNSAFE
    assert parked.selected.judged_by == "near"


def test_noise_of_far_ground_contradicts_nothing() -> None:
    pipe = with_angles()
    seen_from(pipe, ground(), np.array([0.0, 0.0, 12.0]), 0)
    before = (maps(pipe).state == SAFE).sum()
    for second in range(1, 6):
        cloud = ground(second) + np.array([0.0, 0.0, 0.0])
        cloud[:, 2] += np.random.default_rng(second).normal(0, np.radians(0.15) * 30, len(cloud))
        seen_from(pipe, cloud, np.array([30.0, 0.0, 12.0]), second)
    assert (maps(pipe).state == SAFE).sum() == before


@pytest.mark.parametrize("height_m", [5.5, 7.0, 12.0])
def test_a_wire_high_over_the_ground_of_a_stored_cloud_is_unsafe(height_m: float) -> None:
    pipe = pipeline()
    wire = np.column_stack([np.full(60, 1.05), np.linspace(-11, 11, 60), np.full(60, height_m)])
    seen_from(pipe, np.vstack([ground(density=100), wire]), np.full(3, np.nan), 0)
    assert state_at(pipe, 1.05, 0.2) == UNSAFE


def test_a_shaft_is_no_gap() -> None:
    cloud = ground(density=100)
    mouth = (np.abs(cloud[:, 0] - 1.0) < 0.4) & (np.abs(cloud[:, 1] - 1.0) < 0.4)
    cloud[mouth, 2] -= 7.0
    pipe = pipeline()
    seen_from(pipe, cloud, np.full(3, np.nan), 0)
    assert state_at(pipe, 1.0, 1.0) == UNSAFE


@pytest.mark.parametrize("up_m", [6.5, 9.0])
def test_five_returns_of_an_object_high_over_the_ground_count_in_flight(up_m: float) -> None:
    rng = np.random.default_rng(2)
    top = np.column_stack([rng.uniform(0.8, 1.3, 5), rng.uniform(0.5, 0.8, 5), np.full(5, up_m)])
    pipe = pipeline("angle_noise_deg=0.15")
    seen_from(pipe, np.vstack([ground(density=60), top]), np.array([0.0, 0.0, 20.0]), 0)
    assert state_at(pipe, 1.05, 0.65) == UNSAFE


@pytest.mark.parametrize("up_m", [6.5, -7.0])
def test_echoes_beyond_a_gap_that_are_elsewhere_in_every_window_hardly_ever_count(up_m: float) -> None:
    """Of the 240 echoes one in a hundred may meet another by chance, and makes a footprint unsafe."""
    pipe, rng = pipeline("angle_noise_deg=0.15"), np.random.default_rng(3)
    for second in range(12):
        echoes = rng.uniform([-11, -11, up_m], [11, 11, up_m + 2], (20, 3))
        seen_from(pipe, np.vstack([ground(second, density=60), echoes]), np.array([0.0, 0.0, 20.0]), second)
    state = maps(pipe).state
    assert (state == UNSAFE).sum() <= 0.03 * (state == SAFE).sum()


@pytest.mark.parametrize(("returns", "unsafe"), [(5, True), (2, False)])
def test_near_the_sensor_five_returns_are_an_object_whatever_its_pulses_spare(
    returns: int, unsafe: bool
) -> None:
    """A sensor that sends most of its pulses elsewhere, 3 m over the ground: rain is alone, a post is not."""
    rng = np.random.default_rng(6)
    pipe = pipeline("angle_noise_deg=0.15")
    top = np.column_stack(
        [rng.uniform(0.9, 1.2, returns), rng.uniform(0.5, 0.8, returns), np.full(returns, 0.5)]
    )
    cloud = ground(density=500)
    elsewhere = np.hypot(cloud[:, 0], cloud[:, 1]) > 5
    cloud = np.vstack([cloud[elsewhere], ground(density=40)])
    cloud = cloud[(np.abs(cloud[:, 0] - 1.05) > 0.15) | (np.abs(cloud[:, 1] - 0.65) > 0.15)]
    seen_from(pipe, np.vstack([cloud, top]), np.array([0.0, 0.0, 3.0]), 0)
    assert (state_at(pipe, 1.05, 0.65) == UNSAFE) == unsafe


def test_a_clock_that_steps_back_makes_no_ground_younger() -> None:
    pipe = pipeline("max_age_s=30")
    seen_from(pipe, ground(), np.array([0.0, 0.0, 30.0]), 1000)
    elsewhere = ground(density=5)[:60] * [0.1, 0.1, 1] + [-11, -11, 0]
    for second in range(0, 40, 2):
        seen_from(pipe, elsewhere, np.array([0.0, 0.0, 30.0]), second)
    assert state_at(pipe, 5.0, 5.0) != SAFE


@pytest.mark.parametrize("mode", ["default", "source"])
@pytest.mark.parametrize("sensor", [[np.nan] * 3, [np.inf, 0.0, 0.0], [0.0, 0.0, 20.0]])
@pytest.mark.parametrize("up", [1e7, 1e19, -1e300, np.nan])
def test_returns_of_no_sense_are_dropped(mode: str, sensor: list[float], up: float) -> None:
    pipe = Pipeline(params.load("quadcopter", [f"mode={mode}", "zone_m=40"]))
    odd = np.array([[0.0, 0.0, up]])
    assert seen_from(pipe, odd, np.array(sensor), 0).zones == ()
    report = seen_from(pipe, np.vstack([ground(), odd]), np.array(sensor), 1)
    assert report.n_points == len(ground()) + 1


def test_maps_are_given_up_with_their_tiles() -> None:
    """A return that waits for its ground may begin a tile at the rim, so the number wavers by a few."""
    own = ["zone_m=60", "memory_mb=16", "register_m=0", "min_boundary_points=10", "adaptive=off"]
    pipe = Pipeline(params.load("quadcopter", own), (0.0, 0.0))
    alive: set[tuple[int, int]] = set()
    counts = []
    for second in range(110):
        east = 14.0 * second
        cloud = ground(second, density=3) + np.array([east, 0.0, 0.0])
        seen_from(pipe, cloud, np.array([east, 0.0, 20.0]), second)
        terrain = near_map(pipe).terrain
        drawn = pipe.drawn("near", 1_000_000)
        assert drawn is not None
        alive = (alive | {tile.key for tile in drawn.tiles}) - set(drawn.gone)
        counts.append(len(alive))
        assert all(terrain.tiles.any_near(key, 0) for key in alive)
    # 42 windows: tiles and ageing are in step again.
    assert max(counts[67:]) <= max(counts[25:67]) + 4


def test_a_selected_point_is_a_copy() -> None:
    pipe, point = pipeline(), np.array([1.0, 1.0, 0.0])
    pipe.select(point)
    point[:] = 500.0
    report = seen_from(pipe, ground(), np.array([0.0, 0.0, 30.0]), 0)
    assert report.selected is not None
    assert report.selected.enu_m[0] == 1.0


def test_ids_are_not_given_again_in_a_new_frame() -> None:
    pipe = pipeline()
    first = seen_from(pipe, ground(), np.array([0.0, 0.0, 30.0]), 0)
    stamps = np.full(len(ground()), 10**9, np.int64)
    other = LocalFrame(46.0, 8.0, 400.0)
    second = pipe.process(Window(ground(), stamps, np.array([0.0, 0.0, 30.0]), other, 10**9, 10**9))
    assert {zone.id for zone in first.zones}.isdisjoint(zone.id for zone in second.zones)


def test_a_post_that_returns_one_pulse_a_window_is_unsafe_from_the_second_on() -> None:
    pipe, rng = pipeline("angle_noise_deg=0.15"), np.random.default_rng(4)
    states = []
    for second in range(8):
        cloud = ground(second, density=8)
        cloud = cloud[(np.abs(cloud[:, 0] - 1.05) > 0.15) | (np.abs(cloud[:, 1] - 0.65) > 0.15)]
        top = [[1.05 + rng.uniform(-0.15, 0.15), 0.65 + rng.uniform(-0.15, 0.15), 1.5]]
        seen_from(pipe, np.vstack([cloud, top]), np.array([0.0, 0.0, 15.0]), second)
        states.append(state_at(pipe, 1.05, 0.65))
    assert states[0] != UNSAFE
    assert set(states[1:]) == {UNSAFE}


def test_dust_that_is_elsewhere_in_every_window_stays_dust() -> None:
    pipe, rng = pipeline("angle_noise_deg=0.15"), np.random.default_rng(5)
    for second in range(12):
        specks = rng.uniform([-11, -11, 0.8], [11, 11, 8.0], (60, 3))
        report = seen_from(
            pipe, np.vstack([ground(second, density=60), specks]), np.array([0.0, 0.0, 15.0]), second
        )
        assert report.n_used < len(ground(second, density=60)) + 12
    m = maps(pipe)
    assert (m.state == UNSAFE).sum() < 0.03 * (m.state == SAFE).sum()


# Table of the layers: agrees with the kernels, with the parameters and with itself.


every_layer = pytest.mark.parametrize("layer", LAYERS, ids=lambda layer: layer.name)
NEEDS = {
    Output.GEOTIFF: {Output.MAPS, Output.SURVEY},
    Output.PICTURE: {Output.MAPS, Output.SURVEY},
    Output.BUTTON: {Output.PAGE},
}


def test_the_table_has_the_kernels_order() -> None:
    indices = [value for name, value in vars(classify).items() if name.startswith("A_")]
    assert [layer.at for layer in LAYERS] == sorted(indices) == list(range(len(LAYERS)))
    assert LAYERS[-1].at == classify.A_CERTAINTY  # `leave_unknown` writes NaN to all before it
    assert [layer.name for layer in LAYERS if not math.isnan(layer.empty)] == ["certainty"]


def test_no_name_and_no_file_occurs_twice() -> None:
    files = [layer.file for layer in LAYERS if layer.file]
    assert len(NAMED) == len(LAYERS)
    assert len({*files, "safe"}) == len(files) + 1


def test_the_page_gets_the_height_first() -> None:
    assert [layer.is_height for layer in reaching(Output.PAGE)][:2] == [True, False]
    assert not any(layer.is_height for layer in reaching(Output.BUTTON))


@every_layer
def test_a_layer_has_what_its_outputs_need(layer: Layer) -> None:
    for output in layer.outputs:
        assert NEEDS.get(output, set()) <= layer.outputs
    if layer.outputs & {Output.GEOTIFF, Output.PICTURE}:
        assert layer.file
    if Output.PAGE in layer.outputs:
        assert layer.step > 0
    if Output.BUTTON in layer.outputs or (Output.PICTURE in layer.outputs and not layer.is_height):
        assert 0 < round(layer.full / layer.step) <= 254


@every_layer
def test_a_layer_s_limit_is_a_parameter(layer: Layer) -> None:
    assert not layer.limit or layer.limit in {row.name for row in params.rows()}
