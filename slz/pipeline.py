"""The whole method, one window at a time, in the order of the SLZ paper."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.content import describe
from slz.evidence import EvidenceTerrain
from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.landing_point import SelectedPoint, Terrain, judge
from slz.maps import TerrainMaps
from slz.outliers import gap_interval, histogram_interval, in_company
from slz.registration import offset
from slz.repeat import RepeatFilter, ZoneTracker
from slz.report import Report
from slz.search import Candidate, search_components, search_source, side_in_cells
from slz.source_terrain import SourceTerrain
from slz.window import Window
from slz.zone import Zone


class Pipeline:
    """Safe landing zones from windows of georeferenced returns.

    Parameters
    ----------
    parameters
        All parameters; `mode` selects the sources' rules or the default ones.
    centre_enu_m
        East and north of the first zone's centre; None takes the first return (SLZ paper §3.1.2).

    Not thread safe: one thread calls it. Neither points nor reports are changed after they were handed over.
    """

    def __init__(self, parameters: Parameters, centre_enu_m: tuple[float, float] | None = None) -> None:
        self._parameters = parameters
        self._centre = centre_enu_m
        self._reach_m = reach_m(parameters)
        self._source = parameters.mode == "source"
        self._terrain: Terrain | None = None
        self._frame: LocalFrame | None = None
        self._names = self._new_names()
        self._selected: SelectedPoint | None = None

    def process(self, window: Window) -> Report:
        """Run every stage on one window and report the zones of the total map.

        Non-finite points, points beyond `reach_m` of the sensor and lone points are dropped and show as the
        difference of n_points and n_used.
        """
        clock = _Stages()
        sensor = np.array(window.sensor_enu_m, np.float64)  # the kernels take no read-only array
        points = self._usable(window, sensor)
        low, high = self._interval(points[:, 2])
        points = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
        clock.lap("outliers")
        terrain, new_map = self._zone_for(points, window)
        clock.lap("zone")
        if isinstance(terrain, EvidenceTerrain):
            points = self._registered(points, sensor, terrain)
            low, high = -np.inf, np.inf  # those outside are gone
            clock.lap("registration")
        terrain.add(points, sensor, low, high, window.end_ns * 1e-9)
        clock.lap("terrain")
        zones = self._names.update(self._search(terrain), terrain.grid, self._describe)
        clock.lap("zones")
        self._selected = self._judge_selected(terrain, zones)
        clock.lap("landing_point")
        return Report(
            stamp_ns=window.end_ns,
            frame=window.frame,
            grid=terrain.grid,
            zones=tuple(self._ranked(zones)),
            selected=self._selected,
            n_points=len(window),
            n_used=len(points),
            new_map=new_map,
            stage_ms=clock.ms,
        )

    def select(self, enu_m: NDArray[np.float64] | None) -> None:
        """Keep a landing point under watch, or none; the next report says whether it is safe."""
        if enu_m is None:
            self._selected = None
            return
        point = np.asarray(enu_m, np.float64)
        if point.shape != (3,) or not np.isfinite(point[:2]).all():
            raise ValueError(f"a landing point is three numbers, east and north finite, not {enu_m!r}")
        if self._terrain is not None:
            self._selected = judge(point, self._terrain, self._parameters, None)

    def maps(self, box: Box | None = None) -> TerrainMaps | None:
        """Return copies of the maps over a box, by default over all ground seen; None before any."""
        terrain = self._terrain
        if terrain is None or self._frame is None or (box is None and terrain.seen.empty):
            return None
        box = terrain.seen if box is None else box
        return TerrainMaps(
            frame=self._frame,
            grid=terrain.grid,
            box=box,
            height_m=terrain.layer("height_m", box),
            slope_deg=terrain.layer("slope_deg", box),
            roughness=terrain.layer("roughness", box),
            relief_m=terrain.layer("relief_m", box),
            state=terrain.state(box),
        )

    # ---- stages ---------------------------------------------------------------------------------

    def _usable(self, window: Window, sensor_enu_m: NDArray[np.float64]) -> NDArray[np.float64]:
        points = window.points_enu_m
        offset = points[:, :2] - sensor_enu_m[:2]
        far = np.einsum("ij,ij->i", offset, offset) > self._reach_m**2  # never so where the sensor is unknown
        keep = ~far & np.isfinite(points).all(axis=1)
        points = np.ascontiguousarray(points[keep])
        if not self._source and np.isfinite(sensor_enu_m).all():  # a stored cloud was cleaned by who made it
            points = np.ascontiguousarray(points[in_company(points, sensor_enu_m, self._parameters.cell_m)])
        return points

    def _interval(self, height_m: NDArray[np.float64]) -> tuple[float, float]:
        p = self._parameters
        height_m = np.ascontiguousarray(height_m)
        if self._source:
            return histogram_interval(height_m, p.histogram_bins, p.histogram_threshold)
        return gap_interval(height_m, p.outlier_gap_m)

    def _registered(
        self, points: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], terrain: EvidenceTerrain
    ) -> NDArray[np.float64]:
        """Return the points in the map's heights, after following the drift of the window's."""
        points = points - np.array([0.0, 0.0, terrain.datum_m])
        most_m = self._parameters.register_m
        if most_m > 0 and np.isfinite(sensor_enu_m).all():
            found = offset(points, sensor_enu_m, terrain, most_m)
            points[:, 2] -= found.at(points, sensor_enu_m)
            terrain.datum_m += found.up_m
        return points

    def _zone_for(self, points: NDArray[np.float64], window: Window) -> tuple[Terrain, bool]:
        """Zone separation: keep the zone, or create a new one when points lie outside (SLZ paper §3.1.2)."""
        p = self._parameters
        if self._terrain is None or window.frame != self._frame:
            self._frame = window.frame
            first = points[0, :2] if len(points) else window.sensor_enu_m[:2]
            east, north = self._centre or (float(first[0]), float(first[1]))
            self._terrain = self._new_terrain(Grid.centred(east, north, p.zone_m, p.cell_m))
            self._names = self._new_names()
            self._selected = None
            return self._terrain, True
        centre = self._next_centre(points, window, self._terrain.grid)
        if centre is None:
            return self._terrain, False
        old = self._terrain.grid
        down, right = old.index(*centre)
        half_rows, half_cols = old.rows // 2, old.cols // 2
        grid = replace(
            old,
            west_m=old.west_m + (right - half_cols) * old.cell_m,
            south_m=old.south_m + (down - half_rows) * old.cell_m,
        )
        self._terrain = self._terrain.moved(grid)
        self._names.moved(old, grid)
        return self._terrain, True

    def _next_centre(
        self, points: NDArray[np.float64], window: Window, grid: Grid
    ) -> tuple[float, float] | None:
        """Return the centre of the new zone, or None to stay.

        The source moves to the first point outside. The default moves to the vehicle, when it comes nearer to
        an edge than a quarter of the zone, so that one far return does not throw the map away.
        """
        if self._source:
            x, y = points[:, 0], points[:, 1]
            outside = (x < grid.west_m) | (y < grid.south_m) | (x >= grid.east_m) | (y >= grid.north_m)
            if not outside.any():
                return None
            first = points[int(np.argmax(outside))]
            return float(first[0]), float(first[1])
        east, north = float(window.sensor_enu_m[0]), float(window.sensor_enu_m[1])
        room = min(east - grid.west_m, grid.east_m - east, north - grid.south_m, grid.north_m - north)
        return (east, north) if room < self._parameters.zone_m / 4 else None

    def _search(self, terrain: Terrain) -> Iterator[Candidate]:
        p = self._parameters
        search = search_source if self._source else search_components
        seen = terrain.seen.grown(1, terrain.grid)
        least = side_in_cells(p.min_square_m, terrain.grid)
        return search(terrain.safe, seen, least, p.min_boundary_points)

    def _describe(self, candidate: Candidate, zone_id: int) -> Zone:
        if self._terrain is None:
            raise RuntimeError("no terrain")
        return describe(candidate, self._terrain, self._parameters, zone_id)

    def _judge_selected(self, terrain: Terrain, zones: list[Zone]) -> SelectedPoint | None:
        if self._selected is None:
            return None
        point = judge(self._selected.enu_m, terrain, self._parameters, self._selected)
        row, col = terrain.grid.index(float(point.enu_m[0]), float(point.enu_m[1]))
        return replace(point, zone_id=next((zone.id for zone in zones if zone.holds(row, col)), None))

    def _ranked(self, zones: list[Zone]) -> list[Zone]:
        """Best first: the point's certainty to a tenth, then its clearance."""
        ranked = sorted(zones, key=lambda z: (-round(z.best.certainty, 1), -z.best.clearance_m, z.id))
        return ranked[: self._parameters.max_zones]

    def _new_terrain(self, grid: Grid) -> Terrain:
        return (
            SourceTerrain(grid, self._parameters) if self._source else EvidenceTerrain(grid, self._parameters)
        )

    def _new_names(self) -> RepeatFilter | ZoneTracker:
        return RepeatFilter(self._parameters) if self._source else ZoneTracker()


def reach_m(parameters: Parameters) -> float:
    """Return the horizontal distance from the sensor up to which returns are mapped (m).

    An error of a ray's direction moves its return up or down by that angle times the horizontal distance.
    Beyond the distance where this exceeds `height_noise_m`, noise alone would fill the relief limit; such
    ground stays unknown until the vehicle comes nearer. The sources know no such rule.
    """
    p = parameters
    if p.mode == "source" or p.angle_noise_deg == 0:
        return p.max_range_m
    allowed = max(0.0, p.height_noise_m**2 - p.range_noise_m**2) ** 0.5
    return float(min(p.max_range_m, allowed / math.radians(p.angle_noise_deg)))


class _Stages:
    """Stop watch that gives every stage its milliseconds."""

    def __init__(self) -> None:
        self.ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.ms[stage] = (now - self._last) * 1e3
        self._last = now
