"""Beams into water, plants and snow, by whole sensors: returns over incidence, ranges, and two returns."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import Noise
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.sensors.sensor_clock import Clock
from sitl.sensors.velodyne_packets import PACKET, ReturnMode
from sitl.sensors.vlp16 import Vlp16
from sitl.world.primitives import Box, Ground, Kind
from sitl.world.surface_layers import Plants, SurfaceLayers
from sitl.world.water_waves import WaterState
from sitl.world.world import World
from tests.unit.sitl.still_world import hover

F64 = NDArray[np.float64]
MS = 1_000_000
CENTRED = Mount(lever_frd_m=(0.0, 0.0, 0.0))
TURNED = Mount(lever_frd_m=(0.0, 0.0, 0.0), pitch_deg=90.0)
CALM, BREEZE, WINDY = WaterState(0.0), WaterState(3.0), WaterState(8.0)


def mid360(seed: int = 1, noise: Noise | None = None) -> Mid360:
    clock = Clock(offset_ns=0, drift_ppb=0)
    return Mid360(np.random.default_rng(seed), CENTRED, clock=clock, noise=noise or Noise.none())


def layered(
    plants: Plants | None = None,
    depth_m: float | None = None,
    water: WaterState = CALM,
    kind: Kind = Kind.SOIL,
    solids: tuple[Box, ...] = (),
) -> World:
    """Return 200 m of level ground at height 0 under plants, or under water of one depth."""
    squares = (50, 50)
    ground = Ground(-100.0, -100.0, 4.0, np.zeros((51, 51)), np.full(squares, kind, np.uint8))
    level = np.full(squares, np.nan if depth_m is None else depth_m)
    plant = np.full(squares, int(plants is not None), np.uint8)
    layers = SurfaceLayers(level, plant, () if plants is None else (plants,))
    return World(ground, solids, layers=layers, water=water)


def down_and_aside(sensor: PulseLidar, shots: Shots, attitude: F64) -> tuple[F64, F64]:
    """Return height below the sensor of the nominal direction (cosine), and its incidence in degrees."""
    unit = sensor.mount.to_enu(shots.unit, np.tile(attitude, (len(shots), 1)))
    return -unit[:, 2], np.degrees(np.arccos(np.clip(-unit[:, 2], -1, 1)))


def fired(
    world: World, height_m: float, sensor: PulseLidar | None = None, ms: int = 200
) -> tuple[Shots, F64, F64]:
    sensor = sensor or mid360()
    shots = sensor.shots(0, ms * MS, hover(z=height_m), world)
    return shots, *down_and_aside(sensor, shots, np.array([1.0, 0.0, 0.0, 0.0]))


def share_of_returns(world: World, height_m: float) -> F64:
    shots, _, incidence = fired(world, height_m)
    seen = shots.echoes.range_m > 0
    bins = [(0, 3), (3, 6), (6, 10), (10, 15), (15, 20), (20, 30), (30, 50)]
    return np.array([seen[(incidence >= a) & (incidence < b)].mean() for a, b in bins])


@pytest.mark.parametrize("height_m", [10.0, 20.0, 30.0])
@pytest.mark.parametrize("water", [CALM, BREEZE, WINDY])
def test_returns_of_deep_water_fall_with_incidence(water: WaterState, height_m: float) -> None:
    share = share_of_returns(layered(depth_m=3.0, water=water), height_m)
    assert (np.diff(share) <= 0.01).all()
    assert share[0] > 0.6
    assert share[-1] == 0.0


def test_wind_spreads_the_glitter_and_calm_makes_it_fail() -> None:
    calm, breeze, windy = (
        share_of_returns(layered(depth_m=3.0, water=w), 15.0) for w in (CALM, BREEZE, WINDY)
    )
    assert calm[2] == 0.0  # 6 to 10 degrees: more than four times the slope of calm water
    assert windy[3] > breeze[3] > 0.02  # 10 to 15 degrees
    assert windy[4] > 2 * breeze[4]


@pytest.mark.parametrize("water", [BREEZE, WINDY])
def test_glints_vary_as_the_number_of_facets_says(water: WaterState) -> None:
    shots, _, incidence = fired(layered(depth_m=3.0, water=water), 6.0, ms=2000)
    near = incidence < 5.0
    tan = np.tan(np.radians(incidence[near]))
    slope = water.square_slope
    glint = shots.bright[near] / (0.0198 / (4 * slope) * (1 + tan**2) ** 2.5 * np.exp(-(tan**2) / slope))
    assert len(glint) > 1000
    assert glint.mean() == pytest.approx(1.0, rel=0.06)
    assert glint.std() == pytest.approx(1 / np.sqrt(0.5 + 0.35 * water.wind_ms), rel=0.1)
    assert BREEZE.facets < WINDY.facets


def test_murky_water_returns_light_aside_at_short_range() -> None:
    clear, murky = (
        share_of_returns(layered(depth_m=3.0, water=WaterState(2.0, turbid=t)), 12.0) for t in (0.0, 0.02)
    )
    assert clear[5] == 0.0
    assert murky[5] > 0.9


def test_returns_come_from_the_level_of_the_water_within_its_waves() -> None:
    for water, most in ((CALM, 1e-9), (WaterState(8.0, 2000.0), 0.25)):
        world = layered(depth_m=3.0, water=water)
        shots, cosine, _ = fired(world, 15.0)
        seen = shots.echoes.range_m > 0
        z = 15.0 - shots.echoes.range_m[seen] * cosine[seen]
        assert np.abs(z - 3.0).max() <= most
        assert z.std() == pytest.approx(water.height_rms_m, abs=0.015)


def test_an_opaque_lake_is_as_deep_water() -> None:
    squares = np.full((50, 50), Kind.WATER, np.uint8)
    lake = World(Ground(-100.0, -100.0, 4.0, np.zeros((51, 51)), squares), water=BREEZE)
    deep = layered(depth_m=9.0, water=BREEZE)
    np.testing.assert_allclose(
        share_of_returns(lake, 16.0), share_of_returns(deep, 25.0), atol=0.02
    )  # 16 m above either


@pytest.mark.parametrize("depth_m", [0.02, 0.06])
def test_a_puddle_shows_its_bottom_a_third_deeper_where_the_surface_is_dark(depth_m: float) -> None:
    shots, cosine, incidence = fired(layered(depth_m=depth_m), 12.0)
    aside = (shots.echoes.range_m > 0) & (incidence > 20) & (incidence < 45)
    assert aside.sum() > 1000
    inside = np.sqrt(1 - (1 - cosine[aside] ** 2) / 1.328**2)
    way = (12.0 - depth_m) / cosine[aside] + 1.33 * depth_m / inside
    np.testing.assert_allclose(shots.echoes.range_m[aside], way, atol=1e-6)


def test_a_deeper_bottom_is_not_seen() -> None:
    assert not share_of_returns(layered(depth_m=0.6), 20.0)[3:].any()


def test_wet_asphalt_shines_below_and_is_dark_aside() -> None:
    shots, _, incidence = fired(layered(kind=Kind.WET_ASPHALT), 12.0)
    seen = shots.echoes.range_m > 0
    near, aside = (shots.bright[seen & (incidence >= a) & (incidence < b)] for a, b in ((0, 4), (25, 35)))
    assert near.mean() > 0.15
    assert aside.mean() == pytest.approx(0.05 * np.cos(np.radians(30)), rel=0.1)
    assert (seen[(incidence > 20) & (incidence < 50)]).mean() == 1.0


def test_the_reach_over_wet_asphalt_is_shorter_than_over_dry() -> None:
    wet, dry = (share_of_returns(layered(kind=kind), 25.0) for kind in (Kind.WET_ASPHALT, Kind.ASPHALT))
    assert dry[-1] > 0.8
    assert wet[-1] < 0.05


THIN = Plants(Kind.MAIZE, 2.0, 3.0, uneven=0.0)


def test_light_enters_plants_to_a_mean_depth_of_one_over_the_extinction() -> None:
    """Beer-Lambert, for single leaves: the beam's parts before they are merged."""
    world = layered(Plants(Kind.MAIZE, 4.0, 3.0, uneven=0.0))
    rng = np.random.default_rng(1)
    n = 4000
    origins = np.column_stack([rng.uniform(-50, 50, (n, 2)), np.full(n, 20.0)])
    for tilt in (0.0, 0.6):
        direction = np.tile([np.sin(tilt), 0.0, -np.cos(tilt)], (n, 1))
        c = world.cross(origins, direction, 90.0, rng.exponential(1.0, (n, 3)))
        entry = 16.0 / np.cos(tilt)
        depth = (c.leaf_m - entry).ravel()
        assert np.nanmean(depth) == pytest.approx(1 / 3.0, rel=0.03)
        assert np.nanstd(depth) == pytest.approx(1 / 3.0, rel=0.04)
        assert np.isnan(c.leaf_m).mean() == pytest.approx(np.exp(-3.0 * 4.0 / np.cos(tilt)), abs=1e-3)


def test_gaps_between_leaves_let_the_share_of_the_ground_through() -> None:
    world = layered(Plants(Kind.WHEAT, 0.7, 2.0, uneven=0.0))
    rng = np.random.default_rng(2)
    n = 6000
    origins = np.column_stack([rng.uniform(-50, 50, (n, 2)), np.full(n, 12.0)])
    c = world.cross(origins, np.tile([0.0, 0.0, -1.0], (n, 1)), 90.0, rng.exponential(1.0, (n, 3)))
    assert np.isnan(c.leaf_m).mean() == pytest.approx(np.exp(-1.4), abs=0.01)
    assert (c.kind == Kind.SOIL).all()
    np.testing.assert_allclose(c.range_m, 12.0)


def test_rows_are_denser_than_the_gaps_between_them() -> None:
    world = layered(Plants(Kind.MAIZE, 2.0, 1.0, uneven=0.0, row_m=0.75, row_contrast=0.8))
    rng = np.random.default_rng(3)
    n = 8000
    origins = np.column_stack([rng.uniform(-50, 50, (n, 2)), np.full(n, 12.0)])
    c = world.cross(origins, np.tile([0.0, 0.0, -1.0], (n, 1)), 90.0, rng.exponential(1.0, (n, 1)))
    passed, phase = np.isnan(c.leaf_m[:, 0]), origins[:, 0] / 0.75 % 1.0
    share = np.exp(-2.0 * (1.0 + 0.8 * np.cos(2 * np.pi * phase)))
    for where in (np.minimum(phase, 1 - phase) < 0.1, np.abs(phase - 0.5) < 0.1):
        assert passed[where].mean() == pytest.approx(share[where].mean(), abs=0.03)
    assert share.max() > 20 * share.min()


def test_velodyne_reports_leaves_before_the_ground_of_a_maize_field() -> None:
    sensor = Vlp16(
        np.random.default_rng(1),
        TURNED,
        mode=ReturnMode.DUAL,
        clock=Clock(offset_ns=0, drift_ppb=0),
        noise=Noise.none(),
    )
    packets = sensor.scan(0, 100 * MS, hover(z=12.0), layered(Plants(Kind.MAIZE, 2.0, 0.8, 0.0)))
    blocks = np.array([np.frombuffer(packet, PACKET)[0] for packet in packets])["blocks"]
    last, other = (blocks[:, k::2]["channels"]["distance"] * 0.002 for k in (0, 1))
    two = (last > 0) & (last != other)
    assert two.sum() / (last > 0).sum() > 0.2
    assert (other[two] > 0).all()
    assert (last[two] - other[two] > 0.99).all()
    bright = [blocks[:, k::2]["channels"]["reflectivity"] for k in (0, 1)]
    assert (bright[0][two] != bright[1][two]).any()


def test_in_single_mode_a_meadow_is_a_surface_in_its_grass() -> None:
    shots, cosine, incidence = fired(layered(Plants(Kind.MEADOW, 0.15, 6.7, 0.0)), 10.0)
    seen = (shots.echoes.range_m > 0) & (incidence < 40)
    z = 10.0 - shots.echoes.range_m[seen] * cosine[seen]
    assert np.percentile(z, 1) >= 0.0
    assert z.max() <= 0.16
    assert 0.04 < z.mean() < 0.11
    assert seen[incidence < 40].mean() > 0.99


def test_a_roof_above_the_plants_hides_them() -> None:
    shed = Box(0.0, 0.0, 0.0, 20.0, 20.0, 5.0)
    shots, cosine, incidence = fired(layered(THIN, solids=(shed,)), 12.0)
    seen = (shots.echoes.range_m > 0) & (incidence < 20)
    np.testing.assert_allclose(shots.echoes.range_m[seen] * cosine[seen], 7.0, atol=1e-9)


@pytest.mark.parametrize("world", [layered(THIN), layered(depth_m=1.0, water=WINDY)])
def test_output_does_not_depend_on_how_time_is_cut(world: World) -> None:
    noisy = Noise(dropout=0.05, ghost=0.02, dust=0.02)
    whole = mid360(noise=noisy).scan(0, 50 * MS, hover(), world)
    sensor, cut = mid360(noise=noisy), [0, 1, 333_333, 7 * MS, 7 * MS + 1, 20 * MS, 50 * MS]
    assert [p for begin, end in pairwise(cut) for p in sensor.scan(begin, end, hover(), world)] == whole


def test_dry_ground_of_a_world_with_water_is_measured_as_without() -> None:
    noisy = Noise(dropout=0.05, ghost=0.02, dust=0.02)
    dry = World(Ground(-100.0, -100.0, 4.0, np.zeros((51, 51)), np.full((50, 50), Kind.GRASS, np.uint8)))
    far = np.full((50, 50), np.nan)
    far[0, 0] = 1.0
    layers = SurfaceLayers(far, np.zeros((50, 50), np.uint8))
    world = World(dry.ground, layers=layers)
    assert mid360(noise=noisy).scan(0, 50 * MS, hover(), world) == mid360(noise=noisy).scan(
        0, 50 * MS, hover(), dry
    )
