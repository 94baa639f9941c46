"""Simulated flash LiDAR over the borrow pit, with the hazards to be found there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sitl import scenes
from sitl.scenes.hills import BOXES
from sitl.sensors.flash import FlashLidar, RawFrame
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.elevation import ElevationMap, elevation_map, grid_around, relative_elevation
from slz.flash.frame_processing import map_points, process_frame, sensor_points
from slz.flash.hazard_detection import Hazard, find_hazards

F64 = NDArray[np.float64]
LIGHT_M_NS = 0.299792458
CELL_M = 0.1
PLOT_M = 23.5
STEP_M = 6.0
TRUE_M = 0.2  # nothing that stands out less is a hazard


class Pit:
    """The scene, with an instrument that flies around it and looks north and down."""

    def __init__(self, seed: int) -> None:
        self.scene = scenes.build("borrow_pit", seed)
        self.lidar = FlashLidar(np.random.default_rng(seed))

    def pose(self, east_m: float, north_m: float, height_m: float, off_deg: float) -> tuple[F64, F64]:
        """Return position and quaternion from which the axis meets level ground at a place."""
        half = np.radians(off_deg) / 2
        back_m = height_m * np.tan(2 * half)
        return np.array([east_m, north_m - back_m, height_m]), np.array([np.cos(half), 0, np.sin(half), 0])

    def look(
        self, east_m: float, north_m: float, height_m: float = 200.0, off_deg: float = 37.0
    ) -> tuple[RawFrame, F64, F64]:
        """Return a raw frame, the sensor's place and its rotation into the map; 250 m of slant range."""
        position, quat = self.pose(east_m, north_m, height_m, off_deg)
        turn = self.lidar.mount.to_enu(np.eye(3), np.broadcast_to(quat, (3, 4))).T
        return self.lidar.flash(position, quat, self.scene.world), position, turn

    def true_ranges(self, east_m: float, north_m: float) -> F64:
        """Return the ranges of the pixels that see one surface, NaN of the others."""
        delays, _ = self.lidar.echoes(*self.pose(east_m, north_m, 200.0, 37.0), self.scene.world)
        way = delays * LIGHT_M_NS / 2
        return np.where(np.ptp(way, axis=2) < 0.1, way.mean(axis=2), np.nan)

    def points(self, east_m: float, north_m: float) -> F64:
        """Return the map points of one frame."""
        raw, position, turn = self.look(east_m, north_m)
        camera = FlashCamera()
        image = process_frame(FlashFrame(raw.samples, raw.counter), camera)
        return map_points(sensor_points(image, camera)[0], position, turn)


class Score(NamedTuple):
    """Hazards there are and were found, of 0.5 m and of 0.3 m and more; false alarms; area judged."""

    half_metre: tuple[int, int]
    third_metre: tuple[int, int]
    false_alarms: int
    area_m2: float


def judge(pit: Pit) -> Score:
    """Map the plot from 250 m, find the hazards, and compare with the exact scene."""
    axis = np.arange(-24.0, 24.1, STEP_M)
    points = np.concatenate([pit.points(float(x), float(y)) for y in axis for x in axis])
    grid = grid_around(points, CELL_M)
    elevation = elevation_map(points, grid)
    found = find_hazards(relative_elevation(elevation), grid)
    east = grid.west_m + (np.arange(grid.cols) + 0.5) * CELL_M
    north = grid.south_m + (np.arange(grid.rows) + 0.5) * CELL_M
    top, _ = pit.scene.world.surface(*np.meshgrid(east, north))
    truth = relative_elevation(ElevationMap(grid, top, elevation.count))
    standing = [t for t in _standing(pit, truth, east, north) if max(abs(t[0]), abs(t[1])) < PLOT_M]
    hit = [(height, any(_holds(h, x, y) for h in found)) for x, y, height in standing]
    false = [h for h in found if abs(h.east_m) < PLOT_M and abs(h.north_m) < PLOT_M]
    false = [h for h in false if not _is_something(h, truth, east, north)]
    counts = [
        (sum(h >= least for h, _ in hit), sum(seen for h, seen in hit if h >= least)) for least in (0.5, 0.3)
    ]
    return Score(counts[0], counts[1], len(false), (2 * PLOT_M) ** 2)


def _standing(pit: Pit, truth: F64, east: F64, north: F64) -> list[tuple[float, float, float]]:
    """Return east, north and height or depth of all that there is."""
    domes = [(s.x_m, s.y_m, s.radius_z_m) for s in pit.scene.world.solids if hasattr(s, "radius_z_m")]
    marked, _ = ndimage.label(truth < -0.15)
    pits = []
    for k, box in enumerate(ndimage.find_objects(marked), start=1):
        row, col = np.nonzero(marked[box] == k)
        depth = float(-truth[box][marked[box] == k].min())
        x, y = east[box[1].start + int(col.mean())], north[box[0].start + int(row.mean())]
        pits.append((float(x), float(y), depth))
    return [*domes, *BOXES, *pits]


def _holds(hazard: Hazard, x: float, y: float) -> bool:
    west, south, right, top = hazard.extent_m
    return west - CELL_M <= x <= right + CELL_M and south - CELL_M <= y <= top + CELL_M


def _is_something(hazard: Hazard, truth: F64, east: F64, north: F64) -> bool:
    west, south, right, top = hazard.extent_m
    col, row = (east >= west - 0.2) & (east <= right + 0.2), (north >= south - 0.2) & (north <= top + 0.2)
    return bool(np.nanmax(np.abs(truth[np.ix_(row, col)])) >= TRUE_M)
