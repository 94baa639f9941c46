"""Map of one resolution by the paper's rules: its window, its terrain and the zones found in it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Grid
from slz.paper.paper_detection import PaperDetection, Part
from slz.paper.paper_terrain import PaperTerrain
from slz.paper.paper_tracking import RepeatFilter
from slz.paper.paper_zone import describe_paper_zone
from slz.paper.window_cells import WindowCells
from slz.zone import Zone
from slz.zones.detection import side_in_cells
from slz.zones.ranking import Entry, criteria, in_order, reason

Points = NDArray[np.float64]


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
