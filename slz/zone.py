"""Safe landing zone (SLZ), its obstacles and its landing point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.landing_point.corridors import Corridors
from slz.landing_point.helicopter_areas import HelicopterAreas
from slz.landing_point.obstacles import Obstacle
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.footing import ALL_HEADINGS


@dataclass(frozen=True, slots=True)
class LandingPoint:
    """Best point of a zone.

    enu_m : (3,) map frame. clearance_m: distance to the nearest cell outside the zone. square_side_m:
    side of the largest safe square of the zone. certainty: probability that the whole footprint is safe; in
    source mode 1 or 0. horizon_deg: elevation angle of the highest obstacle on the way from the vehicle, NaN
    where nothing was seen. distance_m: horizontal, from the vehicle. surface: what the ground there is.
    corridors: ways in and out, None where they were not judged.
    headings_deg: compass headings to land at; empty where gear, rotor or tail fit at none, None where the map
    does not judge them. blocked_by: what excludes other headings, "" where none is. areas: TLOF, FATO and
    safety area, None without D.
    """

    enu_m: NDArray[np.float64]
    clearance_m: float
    square_side_m: float
    slope_deg: float
    certainty: float
    horizon_deg: float = math.nan
    distance_m: float = math.nan
    surface: SurfaceHere = UNKNOWN_SURFACE
    corridors: Corridors | None = None
    headings_deg: tuple[int, ...] | None = None
    blocked_by: str = ""
    areas: HelicopterAreas | None = None

    @property
    def has_no_heading(self) -> bool:
        """True if the vehicle can land there at no heading."""
        return self.headings_deg == ()

    @property
    def can_land_at_any_heading(self) -> bool:
        """True if no heading is known to be excluded."""
        return self.headings_deg in (None, ALL_HEADINGS)


@dataclass(frozen=True)
class Zone:
    """One safe landing zone (SLZ paper, sections 3.3-3.4).

    box: bounding box of its cells in the grid. cells: uint8 over that box, 1 = zone, the safe cells only.
    boundary_cells: (n, 2) traced rows and columns in the grid. corners_enu_m: (m, 3) boundary after the
    collinear filter. Counts are of cells inside the contour: safe, unsafe (measured), uncertain (no
    elevation). certainty: mean probability of the cells inside the contour, 0 where unknown. slope_deg,
    roughness: means over its measured safe cells. why: reason for its rank behind the zone before it. What
    differs in source mode is in `slz.paper.paper_zone`.
    """

    id: int
    box: Box
    area_m2: float
    certainty: float
    n_safe: int
    n_unsafe: int
    n_uncertain: int
    slope_deg: float
    roughness: float
    boundary_cells: NDArray[np.int32]
    best: LandingPoint
    cells: NDArray[np.uint8]
    corners_enu_m: NDArray[np.float64]
    obstacles: Sequence[Obstacle]
    why: str = ""

    def with_reason(self, why: str) -> Self:
        """Return a copy with the reason for its rank."""
        return self._with(why=why)

    def with_corridors(self, corridors: Corridors) -> Self:
        """Return a copy with the ways in and out of its best point."""
        return self._with(best=replace(self.best, corridors=corridors))

    def _with(self, **changed: object) -> Self:
        """Return a copy with other fields; `dataclasses.replace` takes five times as long."""
        zone = object.__new__(type(self))
        vars(zone).update(vars(self), **changed)
        return zone

    def holds(self, row: int, col: int) -> bool:
        """Return whether a cell of the grid belongs to the zone."""
        r, c = row - self.box.row0, col - self.box.col0
        return 0 <= r < self.cells.shape[0] and 0 <= c < self.cells.shape[1] and bool(self.cells[r, c])


def zone_mask(zones: tuple[Zone, ...], box: Box) -> NDArray[np.bool_]:
    """Return the mask of the cells of a box that belong to a zone; zones may reach beyond the box."""
    out = np.zeros(box.shape, bool)
    for zone in zones:
        own = zone.box
        row0, row1 = max(own.row0, box.row0), min(own.row1, box.row1)
        col0, col1 = max(own.col0, box.col0), min(own.col1, box.col1)
        if row0 < row1 and col0 < col1:
            cells = zone.cells[row0 - own.row0 : row1 - own.row0, col0 - own.col0 : col1 - own.col0]
            out[row0 - box.row0 : row1 - box.row0, col0 - box.col0 : col1 - box.col0] |= cells == 1
    return out
