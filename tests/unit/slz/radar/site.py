"""Landing site, observed by the simulated radar from four sides, and the result of the SLZ stages."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import params
from sitl import scenes
from sitl.sensors.radar import SideLooker, Track
from sitl.truth.truth import safe_map
from sitl.world.primitives import Kind
from slz import Pipeline
from slz.frame import LocalFrame
from slz.grid import Grid
from slz.radar.dem import RadarDem
from slz.radar.interferogram import RadarLines
from slz.window import Window

F64 = NDArray[np.float64]
GRID = Grid(-50.0, -50.0, 0.5, 200, 200)
HEIGHTS_M = (65.0, 75.0, 85.0, 95.0)
"""Of the four flights: at one height the middle would be seen with one and the same turn."""
NEAR, FAR = np.tan(np.radians([28.0, 62.0]))


class Site:
    """The scene, and four observations from 0, 90, 180 and 270 degrees."""

    def __init__(self, seed: int) -> None:
        self.scene = scenes.build("landing_site", seed)
        self.lines = [self._fly(seed, k) for k in range(4)]
        east, north = np.meshgrid(*[-50.0 + (np.arange(200) + 0.5) * 0.5] * 2)
        self.height_m, self.kind = self.scene.world.surface(east, north)

    def _fly(self, seed: int, k: int) -> RadarLines:
        heading, height = k * np.pi / 2, HEIGHTS_M[k]
        ahead = np.array([np.sin(heading), np.cos(heading)])
        right = np.array([ahead[1], -ahead[0]])
        along = (np.arange(130) - 65) * 0.8
        flat = along[:, np.newaxis] * ahead - height * (NEAR + FAR) / 2 * right
        track = Track(np.column_stack([flat, np.full(130, height)]), heading, 0.009 * np.sin(along / 7))
        raw = SideLooker(np.random.default_rng(100 * seed + k)).fly(track, self.scene.world)
        return RadarLines(raw.samples, raw.first_m, raw.step_m, track.position_enu_m, heading, track.roll_rad)

    def even(self) -> NDArray[np.bool_]:
        """Return which cells are dry and rise by less than 0.35 m within 2.5 m."""
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(self.height_m, 2, "edge"), (5, 5))
        return np.asarray((np.ptp(windows, axis=(2, 3)) < 0.35) & (self.kind != Kind.WATER))


class Verdict(NamedTuple):
    """Counts of the objects, of those whose middle is called safe; of steep cells likewise; shares."""

    objects: int
    objects_missed: int
    steep: int
    steep_missed: int
    unsafe_as_safe: float
    recall: float


def judge(site: Site, dem: RadarDem) -> Verdict:
    """Run a DEM through the ordinary stages and compare with the exact world."""
    points, _ = dem.points()
    stamps = np.linspace(0, 0.9e9, len(points)).astype(np.int64)
    pipeline = Pipeline(params.load("radar", ["zone_m=110"]), (0.0, 0.0))
    frame = LocalFrame(47.0, 8.0, 400.0)
    pipeline.process(Window(points, stamps, np.full(3, np.nan), frame, 0, int(stamps[-1])))
    maps = pipeline.maps(which="near")
    assert maps is not None
    grid, box, safe = maps.grid, maps.box, maps.state == 1
    west, south = grid.west_m + box.col0 * 0.5, grid.south_m + box.row0 * 0.5
    extent = (west, south, west + safe.shape[1] * 0.5, south + safe.shape[0] * 0.5)
    truth = safe_map(site.scene.world, extent, 0.5, 3.0, 15.0, 0.5)
    objects = [s for s in site.scene.world.solids if max(abs(s.x_m), abs(s.y_m)) < 47]  # type: ignore[union-attr]
    cells = [(int((s.y_m - south) / 0.5), int((s.x_m - west) / 0.5)) for s in objects]  # type: ignore[union-attr]
    steep = truth.slope_deg > 15.0
    return Verdict(
        len(objects),
        sum(bool(safe[cell]) for cell in cells),
        int(steep.sum()),
        int((steep & safe).sum()),
        float((safe & (truth.safe == 0)).sum() / safe.sum()),
        float((safe & (truth.safe == 1)).sum() / (truth.safe == 1).sum()),
    )
