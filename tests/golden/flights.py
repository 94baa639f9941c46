"""Small flights, surveys and frames with golden values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import params
from sitl.sensors.radar import SideLooker, Track
from sitl.world.primitives import Ground, Kind
from sitl.world.world import World
from slz import SAFE, UNKNOWN, UNSAFE, LocalFrame, Pipeline, Window
from slz.flash.elevation import elevation_map, grid_around, histogram_peaks, relative_elevation
from slz.flash.frame_processing import process_frame, sensor_pixels
from slz.flash.hazard_detection import find_hazards
from slz.flash.segmentation import segment
from slz.grid import Grid
from slz.prior import Surveyed
from slz.radar.dem import RadarDem, fuse, grid_heights
from slz.radar.heights import heights
from slz.radar.interferogram import RadarLines, interferogram
from slz.radar.interferometer import Interferometer
from slz.zones.polygonise import polygonise
from tests.unit.slz.flash.waveforms import frame_of, noisy_camera, some_peaks

F64 = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
S = 1_000_000_000
LINES, BINS = 4, slice(140, 240)  # of the radar


def scene(rng: np.random.Generator, centre: F64, half_m: float, n: int) -> F64:
    """Return returns of ground with a bank, a ditch, three boxes, a mast and a pond that returns nothing."""
    points = np.column_stack([rng.uniform(-half_m, half_m, (n, 2)) + centre, np.zeros(n)])
    east, north = points[:, 0], points[:, 1]
    points[:, 2] = 0.02 * east + 0.3 * np.maximum(0.0, north - 4.0) + rng.normal(0, 0.02, n)
    points[np.abs(east + 6.0) < 0.4, 2] -= 0.6
    for box_east, box_north, side, top in (
        (3.0, -3.0, 1.5, 1.2),
        (-2.0, 2.5, 0.8, 0.7),
        (0.5, -9.0, 0.8, 0.9),
    ):
        points[(abs(east - box_east) < side / 2) & (abs(north - box_north) < side / 2), 2] = top
    mast = (np.hypot(east - 1.0, north + 6.0) < 0.3) & (rng.random(n) < 0.5)
    points[mast, 2] = 3.0 * rng.random(mast.sum())
    return points[np.hypot(east - 6.0, north - 1.0) > 1.2]


def surveyed() -> Surveyed:
    """Level ground known before the flight, with a wood and a lake."""
    grid = Grid(-40.0, -40.0, 1.0, 80, 80)
    state = np.full((80, 80), SAFE, np.uint8)
    state[:, 50:54] = UNSAFE
    state[12:16, :] = UNKNOWN
    height_m = np.fromfunction(lambda row, col: 0.02 * (col - 40) + 0.01 * row - 12.0, (80, 80))
    return Surveyed(grid, state, height_m.astype(np.float32), np.full((80, 80), 1.1, np.float32))


def flight(
    mode: str, *own: str, seconds: int = 3, up_m: float = 18.0, prior: bool = False, n: int = 2600
) -> Iterator[Any]:
    """Yield what the pipeline tells in a flight to the south-west, over which the zone moves."""
    fixed = ["zone_m=20", "cell_m=0.5", "far_cell_m=2", "min_boundary_points=8", "min_square_m=1.5"]
    parameters = params.load("quadcopter", [f"mode={mode}", *fixed, "footprint_m=1.5", *own])
    pipe = Pipeline(parameters, prior=(lambda _frame, _place: surveyed()) if prior else None)
    rng = np.random.default_rng(11)
    for second in range(seconds):
        centre = np.array([-2.5, -3.5]) * second
        points = scene(rng, centre, 7.5, n)
        if second == 2:  # something arrives, and something flies by
            points = np.vstack(
                [points, rng.uniform((-6, -14, 0), (-4.5, -12, 1.4), (300, 3)), [[-9, -9, 7.0]]]
            )
        stamps = second * S + np.linspace(0, 0.9 * S, len(points)).astype(np.int64)
        sensor = np.array([*(0.8 * centre), up_m + second])
        report = pipe.process(Window(points, stamps, sensor, FRAME, int(stamps[0]), int(stamps[-1])))
        yield report
        yield [polygonise(zone.cells) for zone in report.zones]
        for which in ("near", "far"):
            drawn = pipe.drawn(which, 5)
            if drawn is not None:
                yield sorted(drawn.gone), drawn.left, sorted(drawn.tiles, key=lambda tile: tile.key)
        if second == 1 and report.near.zones:
            pipe.select(report.near.zones[0].best.enu_m)
    yield pipe.maps(which="near")
    yield pipe.maps(which="far")


def flash() -> Iterator[Any]:
    """Yield what comes of a frame by both estimators, and of a map with boxes and a pit."""
    camera = noisy_camera(0.05, rows=10, cols=12)
    frame, _ = frame_of(camera, some_peaks(camera, spread=5.0), 1500.0, 0.05)
    for estimator in ("likely", "polynomial"):
        image = process_frame(frame, camera, estimator)  # type: ignore[arg-type]
        yield image
        yield sensor_pixels(image, camera)
    rng = np.random.default_rng(5)
    points = scene(rng, np.zeros(2), 8.0, 4000)
    elevation = elevation_map(points, grid_around(points, 0.25))
    dem = relative_elevation(elevation)
    yield elevation
    yield dem
    yield segment(dem, 2.0)
    yield find_hazards(dem, elevation.grid)
    yield histogram_peaks(dem)


def radar() -> Iterator[Any]:
    """Yield what comes of a pass over a plane with a step, and of observations whose turns differ."""
    axis = np.arange(-200.0, 201.0, 4.0)
    z = np.broadcast_to(0.05 * axis + (axis > 8.0), (101, 101)).copy()
    world = World(Ground(-200.0, -200.0, 4.0, z, np.full((100, 100), Kind.GRASS, np.uint8)))
    instrument, grid = Interferometer(), Grid(-20.0, -8.0, 0.5, 30, 60)
    north = (np.arange(LINES) - LINES / 2) * 0.8
    position = np.column_stack([np.full(LINES, -85.0), north, np.full(LINES, 75.0)])
    track = Track(position, 0.0, np.radians(0.5) * np.sin(north / 3))
    raw = SideLooker(np.random.default_rng(3)).fly(track, world)
    samples, first_m = raw.samples[..., BINS], raw.first_m + BINS.start * raw.step_m
    lines = RadarLines(samples, first_m, raw.step_m, position, 0.0, track.roll_rad, 0.3)
    image = interferogram(lines, instrument)
    found = heights(image, lines, instrument)
    yield image
    yield found
    yield grid_heights(found, instrument, grid)
    rng, shape = np.random.default_rng(4), (12, 15)
    true_m, seen = rng.uniform(-1.0, 2.0, shape), []
    for turn_m in (0.75, 0.9, 1.05, 1.2):
        turns = rng.integers(-1, 2, shape) * (rng.random(shape) < 0.3)
        height_m = true_m + turn_m * turns + rng.normal(0, 0.03, shape)
        height_m[rng.random(shape) < 0.2] = np.nan
        sigma_m = np.where(np.isnan(height_m), np.nan, rng.uniform(0.02, 0.06, shape))
        seen.append(RadarDem(Grid(0, 0, 0.5, *shape), height_m, sigma_m, np.full(shape, turn_m)))
    yield fuse(seen)
    yield fuse(seen, 2)
    yield fuse(seen).points()


KEPT: dict[str, Callable[[], Iterator[Any]]] = {
    "default": lambda: flight("default", "adaptive=off"),
    "adaptive": lambda: flight("default", up_m=45.0, seconds=2),
    "prior": lambda: flight("default", "adaptive=off", seconds=2, prior=True),
    "source": lambda: flight("source"),
    "source max": lambda: flight("source", "fusing=max", "certainty_rule=certain", "adaptive=off"),
    "source fine": lambda: flight(
        "source", "cell_m=0.25", "zone_m=24", "min_square_m=0.5", "adaptive=off", seconds=2, n=3600
    ),
    "flash": flash,
    "radar": radar,
}
