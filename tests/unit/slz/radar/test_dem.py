"""DEM from complex images of the simulated radar, and fusion of observations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.sensors.radar import SideLooker, Track
from sitl.world.primitives import Ground, Kind
from sitl.world.world import World
from slz.grid import Grid
from slz.radar.dem import RadarDem, fuse, observe
from slz.radar.heights import coherence, heights
from slz.radar.interferogram import RadarLines, interferogram
from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]
RADAR = Interferometer()
GRID = Grid(-20.0, -15.0, 0.5, 60, 80)


def world(rise_east: float = 0.0, up_m: float = 0.0, kind: Kind = Kind.GRASS) -> World:
    """Return a plane that rises to the east."""
    axis = np.arange(-200.0, 201.0, 4.0)
    z = np.broadcast_to(up_m + rise_east * axis, (101, 101)).copy()
    return World(Ground(-200.0, -200.0, 4.0, z, np.full((100, 100), kind, np.uint8)))


def fly(ground: World, lines: int = 40, seed: int = 1, level_m: float = 0.0, **more: float) -> RadarLines:
    """Fly north, 75 m high and 85 m west of the middle, swaying."""
    north = (np.arange(lines) - lines / 2) * 0.8
    position = np.column_stack([np.full(lines, -85.0), north, np.full(lines, 75.0)])
    track = Track(position, 0.0, np.radians(0.5) * np.sin(north / 7))
    raw = SideLooker(np.random.default_rng(seed), **more).fly(track, ground)  # type: ignore[arg-type]
    place = (track.position_enu_m, track.heading_rad, track.roll_rad, level_m)
    return RadarLines(raw.samples, raw.first_m, raw.step_m, *place)


@pytest.fixture(scope="module")
def level() -> RadarLines:
    return fly(world())


def test_coherence_of_the_simulated_ground_is_that_of_equation_4(level: RadarLines) -> None:
    """The simulator adds up scatterers; it knows nothing of Eq. (4)."""
    image = interferogram(level, RADAR, common_band=False)
    look = np.arccos(np.minimum(75.0 / level.ranges_m, 1.0))
    for angle in (35.0, 45.0, 52.0):
        near = np.abs(look - np.radians(angle)) < np.radians(2.5)
        found = np.median(image.coherence[:, near])
        assert found == pytest.approx(float(coherence(RADAR, 75.0, np.radians(angle))), rel=0.1)


def test_common_band_leaves_the_coherence_of_the_noise_alone(level: RadarLines) -> None:
    look = np.arccos(np.minimum(75.0 / level.ranges_m, 1.0))
    middle = np.abs(look - np.radians(45.0)) < np.radians(5.0)
    assert np.median(interferogram(level, RADAR).coherence[:, middle]) == pytest.approx(0.952, abs=0.02)


@pytest.mark.parametrize(("rise", "up_m", "level_m"), [(0.0, 0.0, 0.0), (0.0, 1.3, 1.5), (0.07, 0.2, 1.2)])
def test_planes_come_out_where_they_are_as_well_as_told(rise: float, up_m: float, level_m: float) -> None:
    dem = observe(fly(world(rise, up_m), level_m=level_m), RADAR, GRID)
    points, sigma = dem.points()
    error = points[:, 2] - (up_m + rise * points[:, 0])
    assert np.isfinite(dem.height_m).mean() > 0.85
    assert error.std() < 0.05
    assert abs(error.mean()) < 0.01
    assert error.std() == pytest.approx(np.sqrt(np.mean(sigma**2)), rel=0.3)


def test_the_first_antenna_alone_transmitting_doubles_the_error(level: RadarLines) -> None:
    one = Interferometer(both_transmit=False)
    sigma = observe(fly(world(), lines=20, both_transmit=False), one, GRID).points()[1]
    both = observe(level, RADAR, GRID).points()[1]
    assert np.median(sigma) / np.median(both) == pytest.approx(2.0, rel=0.25)


def test_water_and_pure_noise_are_unknown() -> None:
    assert np.isnan(observe(fly(world(kind=Kind.WATER), lines=20), RADAR, GRID).height_m).mean() > 0.999
    rng = np.random.default_rng(2)
    noise = (rng.normal(size=(40, 4, 2, 300, 2)) @ np.array([1, 1j])).astype(np.complex64)
    track = (np.column_stack([np.zeros(40), np.arange(40) * 0.8, np.full(40, 75.0)]), 0.0, np.zeros(40))
    lines = RadarLines(noise, 80.0, 0.25, *track)
    assert len(heights(interferogram(lines, RADAR), lines, RADAR).points_m) < 0.002 * 40 * 300


def a_dem(height: float, turn: float, sigma: float = 0.04) -> RadarDem:
    shape = (2, 2)
    return RadarDem(
        Grid(0, 0, 0.5, 2, 2), np.full(shape, height), np.full(shape, sigma), np.full(shape, turn)
    )


def test_fused_height_is_the_weighted_mean_and_more_certain() -> None:
    fused = fuse([a_dem(1.00, 0.7, 0.02), a_dem(1.06, 1.2, 0.04)])
    assert fused.height_m[0, 0] == pytest.approx((1.00 * 4 + 1.06) / 5)
    assert fused.sigma_m[0, 0] < 0.04


def test_observations_of_different_turns_settle_a_whole_turn() -> None:
    """A crate of 0.97 m, of which each observation sees what its own turn leaves over."""
    fused = fuse([a_dem(0.97 - turn, turn) for turn in (0.75, 0.9, 1.05, 1.2)])
    assert fused.height_m[1, 1] == pytest.approx(0.97, abs=0.01)


def test_what_most_observations_do_not_see_or_contradict_is_unknown() -> None:
    nothing = a_dem(np.nan, np.nan, np.nan)
    assert np.isnan(fuse([a_dem(0.0, 0.9), nothing, nothing, nothing]).height_m).all()
    assert np.isnan(fuse([a_dem(0.0, 0.9), a_dem(0.4, 0.9)]).height_m).all()
    alike = [a_dem(0.0, 0.9), a_dem(0.0, 0.9)]  # may be a crate of 0.9 m just as well
    assert np.isnan(fuse(alike).height_m).all()


def test_bad_input_is_refused_by_name(level: RadarLines) -> None:
    track = (level.position_m, 0.0, level.roll_rad)
    with pytest.raises(ValueError, match="looks"):
        interferogram(level, Interferometer(looks=8))
    with pytest.raises(ValueError, match="complex64"):
        RadarLines(level.samples[:, :, :1], 80.0, 0.25, *track)
    with pytest.raises(ValueError, match="over the ground"):
        RadarLines(level.samples, 80.0, 0.25, *track, level_m=90.0)
    with pytest.raises(ValueError, match="not finite"):
        RadarLines(level.samples, 80.0, 0.25, level.position_m * np.nan, 0.0, level.roll_rad)
    with pytest.raises(ValueError, match="do not reach the ground"):
        interferogram(RadarLines(level.samples[..., :20], 10.0, 0.25, *track), RADAR)
    with pytest.raises(ValueError, match="no observation"):
        fuse([])
    with pytest.raises(ValueError, match="different grids"):
        fuse([a_dem(0, 1), RadarDem(GRID, *[np.zeros((60, 80))] * 3)])


@pytest.mark.parametrize(
    ("agree", "of", "known"),
    [(1, 2, False), (2, 2, True), (1, 3, False), (2, 3, True), (2, 4, False), (3, 4, True), (3, 5, True)],
)
def test_half_of_the_observations_and_one_more_must_agree(agree: int, of: int, known: bool) -> None:
    seen = [a_dem(0.5, 0.7 + 0.13 * k) for k in range(agree)]
    fused = fuse([*seen, *[a_dem(np.nan, np.nan, np.nan)] * (of - agree)])
    assert bool(np.isfinite(fused.height_m).all()) is known
    assert np.isfinite(fused.height_m).any() == known
