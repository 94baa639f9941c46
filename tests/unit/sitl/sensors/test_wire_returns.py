"""Returns of pulsed LiDARs from thin wires, before the ground and before the sky."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import Noise
from sitl.sensors.ouster_os1 import Ouster
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.velodyne_packets import ReturnMode
from sitl.sensors.vlp16 import Vlp16
from sitl.world.hits import DUST, GHOST, GROUND, NOTHING
from sitl.world.primitives import REFLECTANCE, Box, Kind, Solid, Wire
from sitl.world.surface_layers import MEADOW, SurfaceLayers
from sitl.world.world import World
from tests.unit.sitl.still_world import flat_world, hover

I64 = NDArray[np.int64]
S = 1_000_000_000
LEVEL = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=0.0)
"""Axis upward: the view is level."""
DOWN = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)


def with_solids(*solids: Solid) -> World:
    return World(flat_world().ground, solids)


def sensor(kind: type[PulseLidar], mount: Mount = DOWN, seed: int = 1, **options: object) -> PulseLidar:
    settings: dict[str, object] = {"noise": Noise.none(), "mount": mount} | options
    return kind(np.random.default_rng(seed), **settings)  # type: ignore[arg-type, misc]


def same(a: Shots, b: Shots, where: NDArray[np.bool_]) -> bool:
    return all(
        np.array_equal(x[where], y[where], equal_nan=True)
        for x, y in (
            (a.echoes.range_m, b.echoes.range_m),
            (a.echoes.behind_m, b.echoes.behind_m),
            (a.echoes.other_m, b.echoes.other_m),
            (a.bright, b.bright),
            (a.hits.strongest, b.hits.strongest),
        )
    )


@pytest.mark.parametrize("kind", [Mid360, Vlp16, Ouster])
def test_only_pulses_with_a_wire_in_their_footprint_change(kind: type[PulseLidar]) -> None:
    noise = Noise(dropout=0.05, ghost=0.02, dust=0.02)
    wire = Wire((-50.0, 1.0, 4.0), (50.0, 1.0, 4.0), 0.005)
    bare, wired = (
        sensor(kind, noise=noise).shots(0, S // 10, hover(), world)
        for world in (flat_world(), with_solids(wire))
    )
    changed = (bare.bright != wired.bright) | (bare.echoes.range_m != wired.echoes.range_m)
    assert 0 < np.count_nonzero(changed) < 0.05 * len(bare)
    assert same(bare, wired, ~changed)
    # The pulse after a changed one draws the same noise, so that all later ones are the same too.
    far = with_solids(Wire((-50.0, 90.0, 1.0), (50.0, 90.0, 1.0), 0.005))
    assert same(bare, sensor(kind, noise=noise).shots(0, S // 10, hover(), far), np.ones(len(bare), bool))


@pytest.mark.parametrize("kind", [Mid360, Vlp16, Ouster])
def test_before_the_sky_a_wire_returns_where_its_share_of_the_beam_is_enough(kind: type[PulseLidar]) -> None:
    """By the closed form of every pulse at an upright wire to the north, but for those near the threshold."""
    lidar, radius, returned, missed = sensor(kind, LEVEL), 0.005, 0, 0
    for away_m in (5.0, 15.0, 30.0, 60.0):
        wire = Wire((-1e-5, away_m, 20.0), (1e-5, away_m, 90.0), radius)  # a Wire must not be upright
        shots = lidar.shots(0, S // 2, hover(z=50.0), with_solids(wire))
        azimuth = np.arctan2(shots.unit[:, 1], shots.unit[:, 0])
        slant = np.hypot(shots.unit[:, 0], shots.unit[:, 1])
        range_m, aside = away_m * np.cos(azimuth) / slant, np.abs(away_m * np.sin(azimuth))
        exit_m, divergence = lidar.beam.exit_m[0], lidar.beam.divergence_rad[0]
        sigma = (exit_m + divergence * range_m) / math.sqrt(8.0 * math.log(2.0))
        share = special.ndtr((aside + radius) / sigma) - special.ndtr((aside - radius) / sigma)
        bright = share * REFLECTANCE[Kind.METAL] * math.pi / 4 * slant
        exponent = np.log(lidar.reach.at_80_percent_m / lidar.reach.at_10_percent_m) / np.log(8.0)
        relative = np.maximum(bright, 0.0) / 0.1
        reach = lidar.reach.at_10_percent_m * np.where(relative < 1.0, np.sqrt(relative), relative**exponent)
        ahead = (np.abs(azimuth) < 1.0) & (np.abs(aside - radius) < 2.9 * sigma) & (shots.unit[:, 2] > -0.3)
        # The edge of the reach is soft by 12 % at most.
        sure, out = ahead & (range_m < 0.8 * reach), ahead & (range_m > 1.2 * reach)
        assert (shots.hits.strongest[sure] == 0).all()
        assert not (shots.hits.strongest[out] == 0).any()
        np.testing.assert_allclose(shots.echoes.range_m[sure], (range_m - radius)[sure], atol=0.02)
        returned, missed = returned + np.count_nonzero(sure), missed + np.count_nonzero(out)
    assert returned > 100
    assert missed > 20


def test_the_stronger_of_wire_and_ground_is_the_single_return() -> None:
    """By power: a wire of a small share wins only if it is much nearer than the ground."""
    for over_m, wins in ((9.0, True), (2.0, False)):
        wire = Wire((0.0, -5.0, over_m), (0.0, 5.0, over_m), 0.005)
        lidar = sensor(Vlp16)
        shots = lidar.shots(0, S // 10, hover(), with_solids(wire))
        sigma = lidar.beam.width_m(10.0 - over_m)[0] / math.sqrt(8.0 * math.log(2.0))
        most = REFLECTANCE[Kind.METAL] * math.pi / 4 * math.erf(0.005 / sigma / math.sqrt(2.0))
        assert bool(most / (10.0 - over_m) ** 2 > REFLECTANCE[Kind.GRASS] / 100.0) is wins
        assert bool((shots.hits.strongest == 0).any()) is wins


def test_two_returns_hold_the_wire_and_the_ground_behind_it() -> None:
    wire = Wire((-9.0, 0.3, 6.0), (9.0, 0.3, 6.0), 0.01)
    shots = sensor(Vlp16, mode=ReturnMode.DUAL).shots(0, S // 5, hover(), with_solids(wire))
    hits, echoes = shots.hits, shots.echoes
    both = (hits.other == 0) & (hits.behind == GROUND)
    assert np.count_nonzero(both) > 10
    np.testing.assert_allclose((echoes.other_m * shots.unit[:, 0])[both], 4.0, atol=0.05)
    np.testing.assert_allclose((echoes.behind_m * shots.unit[:, 0])[both], 10.0, atol=0.05)
    assert set(np.unique(hits.strongest)) <= {0, GROUND, NOTHING}


def test_a_wire_nearer_to_the_ground_than_two_returns_can_be_is_no_second_return() -> None:
    wire = Wire((-9.0, 0.0, 0.5), (9.0, 0.0, 0.5), 0.01)
    shots = sensor(Vlp16, mode=ReturnMode.DUAL).shots(0, S // 5, hover(), with_solids(wire))
    hits = shots.hits
    assert not ((hits.other == 0) & (hits.behind == GROUND)).any()


def test_hits_name_ground_solid_mover_dust_and_ghost() -> None:
    world = with_solids(Box(1.0, 0.0, 0.0, 1.0, 1.0, 2.0, kind=Kind.ROCK))
    world.add_car("car", -3.0, 0.0, 0.0)
    noise = Noise(range_sigma_m=0.0, angle_sigma_deg=0.0, dropout=0.1, ghost=0.05, dust=0.05, divided=False)
    lidar = sensor(Vlp16, noise=noise)
    shots = lidar.shots(0, S // 5, hover(), world)
    hit, range_m = shots.hits.strongest, shots.echoes.range_m
    assert np.array_equal(hit == DUST, shots.echoes.dust)
    assert np.array_equal((hit == GHOST) & ~shots.echoes.dust, shots.echoes.ghost & ~shots.echoes.dust)
    assert np.array_equal(hit == NOTHING, range_m == 0.0)
    height = 10.0 - shots.unit[:, 0] * range_m
    np.testing.assert_allclose(height[hit == GROUND], 0.0, atol=0.02)
    assert height[hit == 0].max() == pytest.approx(2.0, abs=0.02)
    assert {world.mover_of(code) for code in np.unique(hit)} == {None, "car"}


def test_wires_over_a_meadow_shade_it_and_are_returned() -> None:
    plain = flat_world()
    shape = plain.ground.kind.shape
    layers = SurfaceLayers(np.full(shape, np.nan), np.ones(shape, np.uint8), (MEADOW,))
    wire = Wire((-9.0, 0.0, 9.0), (9.0, 0.0, 9.0), 0.01)
    bare, wired = (
        sensor(Vlp16, mode=ReturnMode.DUAL).shots(
            0, S // 5, hover(), World(plain.ground, solids, layers=layers)
        )
        for solids in ((), (wire,))
    )
    assert (wired.hits.strongest == 0).any()
    changed = bare.bright != wired.bright
    assert same(bare, wired, ~changed & (bare.echoes.range_m == wired.echoes.range_m))
