"""Noise that recordings of real sensors show: tails, biases of lasers, divided beams, intensities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors import ouster_os1, vlp16
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import TAIL_SIGMA_M, Noise
from sitl.sensors.ouster_os1 import OS0, Ouster
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.velodyne_packets import ReturnMode
from sitl.sensors.vlp16 import LASERS, Vlp16
from sitl.world.hits import GROUND, NOTHING
from sitl.world.primitives import Box, Kind
from sitl.world.world import World
from tests.unit.sitl.still_world import flat_world, hover

F64 = NDArray[np.float64]
MS = 1_000_000
DOWN = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)
EDGES = replace(Noise.none(), divided=True)


def shots_of(kind: type[PulseLidar], noise: Noise, world: World, **options: object) -> Shots:
    sensor = kind(np.random.default_rng(1), DOWN, noise=noise, **options)  # type: ignore[call-arg]
    return sensor.shots(0, 200 * MS, hover(), world)


def slab(top_m: float) -> World:
    """Return a flat world whose half east of x = 0 is higher."""
    return World(flat_world().ground, [Box(40.0, 0.0, 0.0, 80.0, 80.0, top_m, kind=Kind.GRASS)])


def height_m(shots: Shots) -> F64:
    """Return the height of returns above the ground, by the directions alone."""
    unit = shots.unit @ DOWN.rotation_frd_from_sensor().T
    height: F64 = 10.0 - unit[:, 2] * shots.echoes.range_m
    return height


def test_range_errors_have_tails_of_a_wider_deviation() -> None:
    noise = replace(Noise.none(), range_sigma_m=0.02, tail=0.1)
    truth = shots_of(Mid360, Noise.none(), flat_world()).echoes.range_m
    measured = shots_of(Mid360, noise, flat_world()).echoes.range_m
    seen = truth > 8.0
    error = (measured - truth)[seen] / 0.02
    assert error.var() == pytest.approx(0.9 + 0.1 * (TAIL_SIGMA_M / 0.02) ** 2, rel=0.05)
    assert (np.abs(error) > 4.0).mean() == pytest.approx(0.1 * 0.110, rel=0.15)  # of 1.6 deviations


@pytest.mark.parametrize(("kind", "rows"), [(Vlp16, LASERS), (Ouster, ouster_os1.ROWS)])
def test_every_laser_has_its_own_constant_error(kind: type[PulseLidar], rows: int) -> None:
    biased = replace(Noise.none(), row_sigma_m=0.01)
    truth, shots = (shots_of(kind, noise, flat_world()) for noise in (Noise.none(), biased))
    seen = truth.echoes.range_m > 0.0
    error = shots.echoes.range_m - truth.echoes.range_m
    of_row = [np.unique(np.round(error[seen & (shots.index % rows == row)], 9)) for row in range(rows)]
    of_row = [found for found in of_row if len(found)]
    assert all(len(found) == 1 for found in of_row)
    assert np.std(np.concatenate(of_row)) == pytest.approx(0.01, rel=0.5)
    assert vlp16.NOISE.row_sigma_m > 0.0
    assert ouster_os1.NOISE.row_sigma_m > 0.0


def test_the_brightness_of_one_surface_varies() -> None:
    noise = replace(Noise.none(), intensity_sigma=0.15)
    plain, shots = (shots_of(Vlp16, each, flat_world()) for each in (Noise.none(), noise))
    seen = plain.echoes.range_m > 0.0
    assert (shots.bright[seen] / plain.bright[seen]).std() == pytest.approx(0.15, rel=0.05)
    assert np.array_equal(shots.echoes.range_m, plain.echoes.range_m)


@pytest.mark.parametrize(("kind", "options"), [(Vlp16, {}), (Ouster, {"model": OS0}), (Mid360, {})])
def test_a_low_step_gives_returns_between_its_sides(
    kind: type[PulseLidar], options: dict[str, object]
) -> None:
    sharp, wide = (shots_of(kind, noise, slab(0.25), **options) for noise in (Noise.none(), EDGES))
    seen = wide.echoes.range_m > 0.0
    assert not between(height_m(sharp)[seen], 0.25).any()
    assert between(height_m(wide)[seen], 0.25).any()
    assert (height_m(wide)[seen] > -0.1).all()


def between(height: F64, top_m: float) -> NDArray[np.bool_]:
    return np.asarray((height > 0.15 * top_m) & (height < 0.85 * top_m))


def test_a_high_step_gives_the_stronger_side_and_two_returns_in_dual_mode() -> None:
    world = slab(3.0)
    sharp, wide = (shots_of(Vlp16, noise, world, mode=ReturnMode.DUAL) for noise in (Noise.none(), EDGES))
    assert not between(height_m(wide)[wide.echoes.range_m > 0.0], 3.0).any()
    two = wide.echoes.behind_m != wide.echoes.other_m
    assert 0.0005 < two.mean() < 0.05
    assert not (sharp.echoes.behind_m != sharp.echoes.other_m).any()
    assert (wide.echoes.behind_m >= wide.echoes.other_m)[two].all()
    assert set(np.unique(wide.hits.behind[two])) <= {0, GROUND, NOTHING}


def test_a_plane_seen_at_a_slant_is_no_edge() -> None:
    plain, wide = (shots_of(Vlp16, noise, flat_world()) for noise in (Noise.none(), EDGES))
    near = (plain.echoes.range_m > 0.0) & (plain.echoes.range_m < 40.0)  # 75 degrees off the vertical
    assert np.array_equal(plain.echoes.range_m[near], wide.echoes.range_m[near])


def test_the_edge_of_an_object_before_the_sky_is_fainter() -> None:
    world = World(flat_world().ground, [Box(0.0, 30.0, 0.0, 4.0, 0.5, 20.0, kind=Kind.GRASS)])
    level = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=0.0)
    sharp, wide = (
        Vlp16(np.random.default_rng(1), level, noise=noise).shots(0, 100 * MS, hover(), world)
        for noise in (Noise.none(), EDGES)
    )
    both = (sharp.hits.strongest == 0) & (wide.hits.strongest == 0)
    fainter = wide.bright[both] < 0.95 * sharp.bright[both]
    assert 0 < fainter.sum() < 0.5 * both.sum()
    assert (wide.bright[both] <= 1.01 * sharp.bright[both]).all()
