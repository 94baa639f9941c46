"""Map of one resolution in default mode: its window, its terrain and the zones found in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Edges, Grid
from slz.landing_point.corridors import Corridors
from slz.terrain.terrain import EvidenceTerrain, Tally
from slz.terrain.tiles import Tiles
from slz.zone import Zone
from slz.zones.description import Content, describe
from slz.zones.detection import Candidate, search_bits, side_in_cells
from slz.zones.ranking import rank
from slz.zones.tile_view import TileView
from slz.zones.tracking import ZoneTracker

Points = NDArray[np.float64]
MOST_JUDGED = 10  # zones whose ways in and out are judged


class ZoneMap:
    """Terrain and zones of one resolution.

    Parameters
    ----------
    centre_enu_m
        East and north of the grid's centre (SLZ paper, section 3.1.2).
    numbers
        IDs for new zones.

    Attributes
    ----------
    candidates
        Zones found by the last search, before they have IDs.
    """

    def __init__(
        self, parameters: Parameters, centre_enu_m: tuple[float, float], numbers: Iterator[int]
    ) -> None:
        self._parameters = parameters
        grid = Grid.centred(*centre_enu_m, parameters.zone_m, parameters.cell_m)
        self.terrain = EvidenceTerrain(grid, parameters)
        self._tracker = ZoneTracker(numbers)
        self.zones: tuple[Zone, ...] = ()
        self.candidates: tuple[Candidate, ...] = ()
        self._contents: dict[int, Content] = {}  # of the zones, by ID
        self.n_without_tile = self.n_evicted = 0

    @property
    def tiles(self) -> Tiles:
        """Evidence of the map."""
        return self.terrain.tiles

    @property
    def tally(self) -> Tally:
        """Numbers of cells of the last window."""
        return self.terrain.tally

    def use(self, parameters: Parameters) -> None:
        """Use other parameters that shape no map, such as `min_certainty`, from the next window on."""
        self._parameters = parameters

    def add_points(
        self,
        points_enu_m: Points,
        sensor_enu_m: Points,
        stamp_s: float,
        isolated_enu_m: Points | None = None,
        like: Tiles | None = None,
        reach_m: float = math.inf,
        altered_m: Sequence[Edges] = (),
    ) -> None:
        """Add a window's points and search the terrain.

        Parameters
        ----------
        points_enu_m
            (n, 3), in stored heights (over `tiles.datum_m`); the sensor position is in the frame's heights.
        isolated_enu_m
            (n, 3) isolated returns, likewise; None for a map that does not judge them.
        like
            Evidence whose datum the points refer to, by default its own.
        reach_m
            Horizontal distance from the sensor beyond which isolated returns are never ground.
        altered_m
            Edges of the places where the surface refuses other cells than before.
        """
        self._follow(sensor_enu_m)
        terrain = self.terrain
        if like is not None:
            terrain.tiles.datum_m = like.datum_m
        sensor_there_m = sensor_enu_m - (0.0, 0.0, terrain.tiles.datum_m)
        change = terrain.add(points_enu_m, sensor_there_m, stamp_s, isolated_enu_m, reach_m, altered_m)
        self.n_without_tile, self.n_evicted = change.n_dropped, len(change.evicted)
        self.candidates = self._search()

    def _follow(self, sensor_enu_m: Points) -> None:
        """Move the grid if required (SLZ paper, section 3.2.5)."""
        old = self.terrain.grid
        centre = self._next_centre(sensor_enu_m, old)
        if centre is not None:
            self._become(self.terrain.moved(old.recentred(*centre)))

    def _next_centre(self, sensor_enu_m: Points, grid: Grid) -> tuple[float, float] | None:
        """Return the centre of the new grid, or None to stay.

        The grid moves to the vehicle when the vehicle is nearer to an edge than a quarter of the zone. It
        does not move for a single far return, which would discard the map.
        """
        east, north = float(sensor_enu_m[0]), float(sensor_enu_m[1])
        margin_m = min(east - grid.west_m, grid.east_m - east, north - grid.south_m, grid.north_m - north)
        return (east, north) if margin_m < self._parameters.zone_m / 4 else None

    def at_level(self, level: int) -> None:
        """Derive the map at another level of the pyramid; zones keep their IDs."""
        if self.terrain.level != level:
            self._become(self.terrain.at_level(level))

    def _become(self, terrain: EvidenceTerrain) -> None:
        self._tracker.regrid(self.terrain.grid, terrain.grid)
        self._contents = {}
        self.terrain = terrain

    def _search(self) -> tuple[Candidate, ...]:
        """Return the candidate zones of the total map."""
        p, terrain = self._parameters, self.terrain
        seen = terrain.seen
        if seen.empty:
            return ()
        scale = terrain.grid.cell_m / p.cell_m
        side = side_in_cells(p.min_square_m, terrain.grid)
        return tuple(search_bits(*terrain.safe_bits(seen), side, max(1, int(p.min_boundary_points / scale))))

    def identify(self, sensor_enu_m: Points) -> None:
        """Assign IDs to the zones found, describe and rank them."""
        p, terrain, before, contents = self._parameters, self.terrain, self._contents, {}
        seen, beside = terrain.seen, math.ceil(p.touchdown_error_m / terrain.grid.cell_m)
        around = Box(seen.row0 - beside, seen.row1 + beside, seen.col0 - beside, seen.col1 + beside)
        view = TileView.of(terrain, around)

        def described(candidate: Candidate, zone_id: int) -> Zone:
            content = contents[zone_id] = Content.of(candidate, terrain, before.get(zone_id), view)
            return describe(content, terrain, sensor_enu_m, p, zone_id, view)

        self.zones = rank(self._tracker.update(self.candidates, described), p)
        self._contents = contents

    def judge_ways(self, ways: Callable[[Points], Corridors]) -> None:
        """Judge the ways in and out of the best zones, and rank the zones anew."""
        best = [zone.with_corridors(ways(zone.best.enu_m)) for zone in self.zones[:MOST_JUDGED]]
        self.zones = rank([*best, *self.zones[MOST_JUDGED:]], self._parameters)
