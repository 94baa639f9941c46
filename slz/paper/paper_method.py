"""Paper method: the rules of the SLZ paper to the letter, unsafe ones included."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.adaptive import Adapter
from slz.frame import MapFrame
from slz.grid import Grid
from slz.landing_point.judgement import SelectedPoint, unknown
from slz.lanes import timed
from slz.method import MethodResult, centre_of
from slz.paper.paper_detection import PaperDetection, Part
from slz.paper.paper_report import PaperReport
from slz.paper.paper_terrain import PaperTerrain
from slz.paper.paper_tracking import RepeatFilter
from slz.paper.paper_zone import describe_paper_zone
from slz.paper.window_cells import WindowCells
from slz.report import MapReport
from slz.window import Window
from slz.zone import Zone
from slz.zones.detection import side_in_cells
from slz.zones.ranking import Entry, criteria, in_order, reason

Points = NDArray[np.float64]
ANYWHERE = Grid(0.0, 0.0, 1.0, 1, 1)


class PaperMap:
    """Terrain and zones of one resolution; parameters are those of `slz.zones.zone_map.ZoneMap`."""

    n_without_tile = n_evicted = 0
    tally = None

    def __init__(
        self, parameters: Parameters, centre_enu_m: tuple[float, float], numbers: Iterator[int]
    ) -> None:
        self._parameters = parameters
        self._tracker = RepeatFilter(parameters, numbers)
        self._entries: dict[int, Entry] = {}  # of the zones, by ID
        self._pairs: dict[tuple[int, int], tuple[Zone, Zone, Zone]] = {}  # by IDs
        self._found: tuple[Part, ...] = ()
        self.zones: tuple[Zone, ...] = ()
        grid = Grid.centred(*centre_enu_m, parameters.zone_m, parameters.cell_m)
        self._use(PaperTerrain(grid, parameters))

    def _use(self, terrain: PaperTerrain) -> None:
        p = self._parameters
        self.terrain = terrain
        scale = terrain.grid.cell_m / p.cell_m
        least = max(1, int(p.min_boundary_points / scale))
        self._search = PaperDetection(terrain, side_in_cells(p.min_square_m, terrain.grid), least)

    def fuse(self, returns: WindowCells) -> int:
        """Fuse returns placed in this map's grid with the terrain; return how many were used."""
        return self.terrain.fuse(returns)

    def move(self, east_m: float, north_m: float) -> None:
        """Move the grid to a point outside it; the common part is copied (SLZ paper, section 3.2.5)."""
        old = self.terrain.grid
        grid = old.recentred(east_m, north_m)
        self._tracker.regrid(old, grid)
        self._use(self.terrain.moved(grid))

    def detect_zones(self, sensor_enu_m: Points) -> None:
        """Search the total map for zones, identify and rank them."""
        found = self._search.update()
        if found is self._found and not self._tracker.changed:
            return
        self._found = found
        named = self._tracker.update(
            found,
            lambda part, zone_id: describe_paper_zone(
                part, self.terrain, self._search, sensor_enu_m, self._parameters, zone_id
            ),
        )
        self.zones = self._ranked(named)

    def _ranked(self, zones: list[Zone]) -> tuple[Zone, ...]:
        """Return ranked zones as `slz.zones.ranking.rank` does; only new zones and new pairs are compared."""
        p, entries, pairs = self._parameters, {}, {}
        for zone in zones:
            known = self._entries.get(zone.id)
            entries[zone.id] = known if known and known[1] is zone else (criteria(zone, p), zone)
        order = in_order(entries.values(), p.max_zones)
        for above, entry in itertools.pairwise(order):
            other, zone = above[1], entry[1]
            pair = self._pairs.get((other.id, zone.id))
            if pair is None or pair[0] is not other or pair[1] is not zone:
                pair = other, zone, zone.with_reason(reason(entry, above, p))
            pairs[other.id, zone.id] = pair
        self._entries, self._pairs = entries, pairs
        return (*(zone for _, zone in order[:1]), *(pair[2] for pair in pairs.values()))


class PaperMethod:
    """As the SLZ paper has it, one map at a time; time follows the returns and the ground they hit.

    Parameters
    ----------
    centre_enu_m
        East and north of the first window's centre; None takes the first return (SLZ paper, section 3.1.2).
    follow
        Whether a return outside the zone moves it there (section 3.2.5) or is passed over.
    """

    report = PaperReport

    def __init__(
        self, parameters: Parameters, centre_enu_m: tuple[float, float] | None, follow: bool
    ) -> None:
        self._p = parameters
        self._follow = follow
        far = parameters.model_copy(update={"cell_m": parameters.far_cell_m})
        self._parameters_of_maps = parameters, far
        self._centre, self._numbers = centre_enu_m, itertools.count(1)
        self._frame: MapFrame | None = None
        self.maps: tuple[PaperMap, PaperMap] | None = None
        self._adapter = Adapter(parameters)
        self._returns = WindowCells()
        self._far_was_active = False

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from the next window on; none that the sources' rules read may change."""
        self._p = parameters

    def process(
        self, window: Window, frame: MapFrame, selected: SelectedPoint | None, ms: dict[str, float]
    ) -> MethodResult:
        """Run outlier removal, the choice of the map, terrain and zones on a window."""
        sensor_enu_m = window.sensor_known_m
        if self.maps is None or frame != self._frame:
            self.maps = self._new_maps(window, sensor_enu_m)
            self._adapter, self._far_was_active, self._frame = Adapter(self._p), False, frame
        near, far = self.maps
        with timed("outliers", ms):
            guess = far if self._far_was_active else near
            returns = self._read(window, sensor_enu_m, guess.terrain.grid)
        with timed("choice", ms):
            choice = self._adapter.choose_from_cells(window, returns)
            active = far if choice.far else near
            if active is not guess:
                returns = self._read(window, sensor_enu_m, active.terrain.grid)
        with timed("terrain", ms):
            outside = returns.first_outside() if self._follow else None
            if outside is not None:
                active.move(*outside)
                returns = self._read(window, sensor_enu_m, active.terrain.grid)
            n_used = active.fuse(returns)
        with timed("zones", ms):
            near.detect_zones(sensor_enu_m)
            far.detect_zones(sensor_enu_m)
        self._far_was_active = choice.far
        return MethodResult(near, far, choice, n_used)

    def without_map(self, enu_m: Points, before: SelectedPoint | None) -> SelectedPoint:
        """Return the last state of a point that both windows left behind (SLZ thesis, section 4.3.2.2)."""
        return unknown(enu_m) if before is None else replace(before, judged_by="none", zone_id=None)

    def corridors(self, enu_m: Points) -> None:
        """Return None: the sources leave the way in to the pilot."""

    def watched_ground(self, enu_m: Points) -> None:
        """Return None: the sources judge by windows of a second alone."""

    def prior_report(self) -> MapReport | None:
        """Return None: the sources know no ground surveyed before the flight."""
        return None

    def _new_maps(self, window: Window, sensor_enu_m: Points) -> tuple[PaperMap, PaperMap]:
        """Return a near and a far map at the window's first point."""
        centre = self._centre or centre_of(self._read(window, sensor_enu_m, ANYWHERE).kept()[:1], window)
        near, far = (PaperMap(p, centre, self._numbers) for p in self._parameters_of_maps)
        return near, far

    def _read(self, window: Window, sensor_enu_m: Points, grid: Grid) -> WindowCells:
        """Place a window's returns in a grid and drop the outliers among them (SLZ paper, section 3.2.1)."""
        p = self._p
        self._returns.read(window.points_enu_m, sensor_enu_m, p.max_range_m, grid)
        self._returns.keep_heights(p.histogram_bins, p.histogram_threshold)
        return self._returns
