"""Prior map: ground surveyed before the flight, known from the first window on, below any live return.

The prior is a layer of its own. It is no evidence in the cells of the live maps. So it makes nothing safe
that no live return hit, and outvotes no live return. Where a live map is known, safe or unsafe, the prior is
unknown. A single live return above or below the surveyed ground removes that ground from the prior for the
rest of the flight, at any distance from the sensor. The remaining zones are to fly to and inspect: the live
maps alone decide whether a point in one is safe (`landing_point.judgement.judge_point`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz.frame import LocalFrame, is_known
from slz.grid import Box, Grid
from slz.kernels.points.prior_agreement import contradict, heights_over
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.terrain.terrain_view import TerrainView, UnboundedTerrain
from slz.zone import Zone
from slz.zones.description import Content, describe
from slz.zones.detection import Candidate, search_components, side_in_cells
from slz.zones.ranking import rank
from slz.zones.tracking import ZoneTracker

CERTAINTY = 0.5  # of surveyed ground: less than a landing requires (`min_certainty`)
FEWEST_COMPARED = 200
AGREEING = 0.5  # share of returns that must agree with the survey; else all ground hit is removed
FIRST_ID = 100_001  # of its zones, so that the live maps' zones have the same IDs with and without a prior
LEVEL_M = 0.05  # change of the survey's level after which its zones are searched again
LATER_S = 5.0  # period of the comparison with the cells known to the live maps
AGAIN_M = 100.0  # distance from a place without survey, after which the source is asked again
SAMPLE = 20_000  # returns from which the level of the survey is found
Points = NDArray[np.float64]
T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Surveyed:
    """Surveyed ground in the map frame: state as in `TerrainMaps`, heights (m, up) and slopes (degrees).

    The zero of the heights may differ from the map's.
    """

    grid: Grid
    state: NDArray[np.uint8]
    height_m: NDArray[np.float32]
    slope_deg: NDArray[np.float32]


Source = Callable[[LocalFrame, Points], Surveyed | None]
"""Returns the surveyed ground around a position (3,) in a frame; None where there is none."""


class PriorTerrain(UnboundedTerrain):
    """Surveyed ground that no return contradicted, as a `TerrainView`.

    offset_m: height of the survey's zero over the zero of the live maps' stored heights. datum_m: height of
    the latter, see `slz.terrain.tiles.Tiles`.
    """

    def __init__(self, surveyed: Surveyed) -> None:
        self.surveyed = surveyed
        self.given_up = np.zeros(surveyed.state.shape, np.uint8)
        self.hidden = np.zeros(surveyed.state.shape, bool)
        self.offset_m = self.datum_m = 0.0

    @property
    def level_m(self) -> float:
        """Height of the survey's zero in the map frame."""
        return self.offset_m + self.datum_m

    @property
    def grid(self) -> Grid:
        return self.surveyed.grid

    @property
    def _whole(self) -> NDArray[np.uint8]:
        state = np.where(self.given_up == 1, UNSAFE, self.surveyed.state)
        return np.where(self.hidden & (self.given_up == 0), UNKNOWN, state)

    def state(self, box: Box) -> NDArray[np.uint8]:
        return _window(self._whole, box, int(UNKNOWN))

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        if name == "certainty":
            return np.where(self.state(box) == SAFE, np.float32(CERTAINTY), np.float32(0))
        if name in ("height_m", "top_m"):
            return np.asarray(_window(self.surveyed.height_m, box, np.nan) + np.float32(self.level_m))
        if name == "slope_deg":
            return _window(self.surveyed.slope_deg, box, np.nan)
        return np.full(box.shape, np.nan, np.float32)


class Prior:
    """Zones on surveyed ground that no live return contradicts and no live map covers.

    Parameters
    ----------
    source
        Returns the surveyed ground; called once for a frame, and again when the vehicle leaves the middle of
        that ground, or the place where there was none.
    """

    def __init__(self, source: Source, parameters: Parameters) -> None:
        self._source = source
        self._parameters = parameters
        self._ids = itertools.count(FIRST_ID)
        self._tracker = ZoneTracker(self._ids)
        self._frame: LocalFrame | None = None
        self._asked: Points | None = None
        self._marks: tuple[Grid, NDArray[np.int64]] | None = None
        self.terrain: PriorTerrain | None = None
        self._compared_s = -math.inf
        self._registered = False
        self._offset_m = 0.0
        self._dirty, self._level_m = True, 0.0
        self.zones: tuple[Zone, ...] = ()

    def use(self, parameters: Parameters) -> None:
        """Use other parameters that shape no map; the zones are ranked anew with the next window."""
        self._parameters, self._dirty = parameters, True

    @property
    def grid(self) -> Grid | None:
        """Raster of the surveyed ground in the map frame; None where there is none."""
        return None if self.terrain is None else self.terrain.grid

    def update(
        self,
        points_enu_m: Points,
        sensor_enu_m: Points,
        frame: LocalFrame,
        now_s: float,
        live: tuple[TerrainView, ...],
        datum_m: float = 0.0,
    ) -> None:
        """Compare a window's returns with the survey and update the zones.

        Parameters
        ----------
        points_enu_m
            (n, 3) returns of the window, outliers removed, at any range, in the live maps' stored heights.
        now_s
            A time that never decreases within a frame.
        live
            The live maps, which override the prior.
        datum_m
            Height of the maps' frame over their stored heights.
        """
        self._follow(frame, sensor_enu_m)
        terrain = self.terrain
        if terrain is None:
            return
        terrain.datum_m = datum_m
        if self._contradicted(terrain, points_enu_m, sensor_enu_m):
            self._dirty = True
            self._remove_contradicted(terrain)
        due = now_s - self._compared_s >= LATER_S
        overruled = any(self._overruled(zone, terrain, live) for zone in self.zones)
        if not (due or overruled):
            return
        self._compared_s = now_s
        if abs(terrain.level_m - self._level_m) > LEVEL_M:
            self._dirty = True
        hidden = known_to(live, terrain.grid)
        if overruled or self._dirty or not np.array_equal(hidden, terrain.hidden):
            terrain.hidden, self._dirty, self._level_m = hidden, False, terrain.level_m
            self.zones = self._found(terrain, sensor_enu_m)

    def _remove_contradicted(self, terrain: PriorTerrain) -> None:
        """Remove contradicted ground from the zones at once; their outlines follow with the next search."""
        clear = self._clear(terrain).astype(np.uint8)
        self.zones = tuple(replace(zone, cells=zone.cells & clear[zone.box.slices]) for zone in self.zones)

    def _clear(self, terrain: PriorTerrain) -> NDArray[np.bool_]:
        """Return the cells whose footprints hold no contradicted ground."""
        half = max(1, math.ceil(self._parameters.footprint_m / 2 / terrain.grid.cell_m))
        return ~ndimage.maximum_filter(terrain.given_up, 2 * half + 1).astype(bool)

    def _follow(self, frame: LocalFrame, sensor_enu_m: Points) -> None:
        """Load other ground in a new frame, and when the vehicle is a quarter of the side off the middle."""
        if frame != self._frame:
            self._frame, self._asked, self.terrain, self.zones = frame, None, None, ()
            self._marks, self._registered, self._offset_m = None, False, 0.0
            self._tracker = ZoneTracker(self._ids)
        if self._asked is not None and not is_known(sensor_enu_m):
            return
        here = np.nan_to_num(sensor_enu_m)
        old = self.terrain
        if self._asked is not None:
            middle_m = AGAIN_M
            if old is not None:
                middle_m = min(old.grid.rows, old.grid.cols) * old.grid.cell_m / 4
            if np.abs(here[:2] - self._asked[:2]).max() < middle_m:
                return
        self._asked = here
        surveyed = self._source(frame, here)
        self.terrain = None if surveyed is None else PriorTerrain(surveyed)
        self.zones, self._compared_s, self._dirty = (), -math.inf, True
        if old is not None:
            self._offset_m = old.offset_m
            self._marks = _remembered(self._marks, old)
        if self.terrain is not None:
            self.terrain.offset_m = self._offset_m
            if self._marks is not None:
                _mark(self.terrain, *self._marks)
            if old is not None:
                self._tracker.regrid(old.grid, self.terrain.grid)
        else:
            self._tracker = ZoneTracker(self._ids)  # the next survey has another raster

    def _contradicted(self, terrain: PriorTerrain, points: Points, sensor: Points) -> int:
        """Remove surveyed ground that returns contradict; return how many cells are new.

        The height of the ground over the survey is estimated in every window: the datum of the survey differs
        from the autopilot's, and a barometer drifts.
        """
        p, grid, surveyed = self._parameters, terrain.grid, terrain.surveyed
        place = (grid.west_m, grid.south_m, grid.cell_m)
        if not np.isfinite(sensor).all():
            return 0
        over = heights_over(points, *place, (surveyed.state == SAFE).view(np.uint8), surveyed.height_m)
        hit = np.flatnonzero(np.isfinite(over))
        least_m, noise = p.relief_m, math.radians(p.angle_noise_deg)
        if len(hit) >= FEWEST_COMPARED:
            sample = over[hit[:: max(1, len(hit) // SAMPLE)]]
            middle = float(np.median(sample))
            if float((np.abs(sample - middle) <= least_m).mean()) >= AGREEING:
                terrain.offset_m, self._registered = middle, True
            else:  # wrong ground, or ground that changed as a whole: all cells hit are removed
                least_m, noise = -1.0, 0.0
        elif not self._registered:
            return 0  # too few returns to find the level of the survey
        return int(
            contradict(points, over, sensor, terrain.offset_m, least_m, noise, *place, terrain.given_up)
        )

    def _overruled(self, zone: Zone, terrain: PriorTerrain, live: tuple[TerrainView, ...]) -> bool:
        """Return whether a return or a live map contradicts a zone's landing point."""
        row, col = terrain.grid.index(*zone.best.enu_m[:2].tolist())
        if not zone.holds(row, col):
            return True
        reach_m = self._parameters.footprint_m / 2 + self._parameters.touchdown_error_m
        east, north = zone.best.enu_m[:2].tolist()
        for seen in live:
            row0, col0 = seen.grid.index(east - reach_m, north - reach_m)
            row1, col1 = seen.grid.index(east + reach_m, north + reach_m)
            if (seen.state(Box(row0, row1 + 1, col0, col1 + 1)) == UNSAFE).any():
                return True
        return False

    def _found(self, terrain: PriorTerrain, sensor: Points) -> tuple[Zone, ...]:
        p, grid = self._parameters, terrain.grid
        box = grid.everything
        safe = ((terrain.state(box) == SAFE) & self._clear(terrain)).astype(np.uint8)
        fewest = max(1, int(p.min_boundary_points * p.cell_m / grid.cell_m))
        side = side_in_cells(p.min_square_m, grid)
        found = search_components(safe, box, side, fewest)

        def described(one: Candidate, number: int) -> Zone:
            return describe(Content.of(one, terrain), terrain, sensor, p, number)

        return rank(self._tracker.update(found, described), p)


def known_to(live: tuple[TerrainView, ...], grid: Grid) -> NDArray[np.bool_]:
    """Return the cells of a raster whose centres are known to a live map."""
    out = np.zeros((grid.rows, grid.cols), bool)
    for terrain in live:
        own = terrain.grid
        rows = np.floor(
            (grid.south_m + (np.arange(grid.rows) + 0.5) * grid.cell_m - own.south_m) / own.cell_m
        )
        cols = np.floor((grid.west_m + (np.arange(grid.cols) + 0.5) * grid.cell_m - own.west_m) / own.cell_m)
        r, c = (np.flatnonzero((at >= 0) & (at < most)) for at, most in ((rows, own.rows), (cols, own.cols)))
        if not (len(r) and len(c)):
            continue
        there_r, there_c = rows[r].astype(np.int64), cols[c].astype(np.int64)
        box = Box(int(there_r[0]), int(there_r[-1]) + 1, int(there_c[0]), int(there_c[-1]) + 1)
        state = terrain.state(box)[np.ix_(there_r - box.row0, there_c - box.col0)]
        out[np.ix_(r, c)] |= state != UNKNOWN
    return out


def _remembered(
    marks: tuple[Grid, NDArray[np.int64]] | None, old: PriorTerrain
) -> tuple[Grid, NDArray[np.int64]]:
    """Return all cells (n, 2) ever removed, in the indices of a base raster."""
    base, cells = marks or (old.grid, np.empty((0, 2), np.int64))
    return base, np.unique(np.vstack([cells, np.argwhere(old.given_up) + old.grid.shift_to(base)]), axis=0)


def _mark(terrain: PriorTerrain, base: Grid, cells: NDArray[np.int64]) -> None:
    """Remove cells, given in another raster, from a terrain."""
    there = cells + base.shift_to(terrain.grid)
    inside = ((there >= 0) & (there < (terrain.grid.rows, terrain.grid.cols))).all(axis=1)
    terrain.given_up[tuple(there[inside].T)] = 1


def _window(values: NDArray[T], box: Box, empty: float) -> NDArray[T]:
    """Return a copy of a box of an array; the box may extend beyond it."""
    out = np.full(box.shape, empty, values.dtype)
    rows, cols = values.shape
    row0, row1, col0, col1 = max(0, box.row0), min(rows, box.row1), max(0, box.col0), min(cols, box.col1)
    if row0 < row1 and col0 < col1:
        there = slice(row0 - box.row0, row1 - box.row0), slice(col0 - box.col0, col1 - box.col0)
        out[there] = values[row0:row1, col0:col1]
    return out
