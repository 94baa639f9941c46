"""Areas of a heliport around a landing point: TLOF, FATO and safety area, by multiples of D.

D is the greatest dimension of the vehicle with rotors turning. A touchdown and lift-off area (TLOF) holds a
circle of 0.83 D (French decree of 29 September 2009 on heliports, DEVA0916303A, annex II, 1.3.1). A final
approach and take-off area (FATO) is 1.5 D across (FAA AC 150/5390-2B, hospital heliports: 1.5 overall
lengths). The safety area around it is 0.25 D wide, and at least 3 m, and with the FATO at least 2 D across
(the decree, 1.4.1). Nothing in it may be more than 20 cm above the FATO's edge (AC 150/5390-2B, 303 d).

An area is only said to be met where all its ground was seen. Whether ground bears the vehicle, and whether an
object in the safety area is frangible, a LiDAR does not see.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box
from slz.terrain.terrain_maps import SAFE, UNKNOWN
from slz.terrain.terrain_view import TerrainView

TLOF_D = 0.83
FATO_D = 1.5
SAFETY_AREA_D = 0.25
LEAST_SAFETY_AREA_M = 3.0
HIGHEST_OBJECT_M = 0.2
LEAST_GROUND = 3  # cells that a plane needs

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class HelicopterAreas:
    """Areas of a vehicle of dimension D that fit around a point.

    tlof, fato, safety_area: why the area does not fit, in words; "" where it does.
    """

    d_m: float
    tlof: str
    fato: str
    safety_area: str

    @property
    def n_met(self) -> int:
        """Number of areas that fit, of three."""
        return sum(not why for why in (self.tlof, self.fato, self.safety_area))

    @property
    def text(self) -> str:
        """All three in words."""
        named = (
            (f"TLOF {TLOF_D:g} D", self.tlof),
            (f"FATO {FATO_D:g} D", self.fato),
            ("safety area", self.safety_area),
        )
        return ", ".join(f"{name} no: {why}" if why else f"{name} yes" for name, why in named)


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """Cells around a point: nearest distance of each (m), state, slope (deg) and height over a plane (m).

    over_m: of highest returns, on safe cells of mean heights; NaN where nothing was seen.
    """

    nearest_m: Floats
    state: NDArray[np.uint8]
    slope_deg: Floats
    over_m: Floats


def helicopter_areas(enu_m: Floats, terrain: TerrainView, parameters: Parameters) -> HelicopterAreas | None:
    """Return the areas around a point (3,); None for a vehicle without D, or a point that is nowhere."""
    d_m = parameters.greatest_dimension_m
    if not d_m or not np.isfinite(enu_m[:2]).all():
        return None
    fato_m = FATO_D * d_m / 2
    safety_m = max(fato_m + max(SAFETY_AREA_D * d_m, LEAST_SAFETY_AREA_M), d_m)
    around = _around(enu_m, terrain, fato_m, safety_m + parameters.footprint_m)
    return HelicopterAreas(
        d_m=d_m,
        tlof=_lacking(around, around.nearest_m < TLOF_D * d_m / 2, parameters),
        fato=_lacking(around, around.nearest_m < fato_m, parameters),
        safety_area=_obstructed(around, (around.nearest_m >= fato_m) & (around.nearest_m < safety_m)),
    )


def _around(enu_m: Floats, terrain: TerrainView, plane_m: float, reach_m: float) -> Around:
    """Return the cells within a reach of a point, over the plane of the safe ground within `plane_m`."""
    grid = terrain.grid
    row, col = grid.index(float(enu_m[0]), float(enu_m[1]))
    reach = math.ceil(reach_m / grid.cell_m)
    whole = Box(row - reach, row + reach + 1, col - reach, col + reach + 1)
    box = terrain.around(Box(row, row + 1, col, col + 1), reach)
    inside = np.s_[
        box.row0 - whole.row0 : box.row1 - whole.row0, box.col0 - whole.col0 : box.col1 - whole.col0
    ]
    state = np.full(whole.shape, UNKNOWN, np.uint8)
    height, top, slope = (np.full(whole.shape, np.nan) for _ in range(3))
    state[inside] = terrain.state(box)
    height[inside], top[inside] = terrain.ground_and_top(box)
    slope[inside] = terrain.layer("slope_deg", box)
    centre_east, centre_north = grid.centre(whole.row0, whole.col0)
    rows, cols = np.ogrid[: whole.shape[0], : whole.shape[1]]
    north = centre_north + rows * grid.cell_m - float(enu_m[1])
    east = centre_east + cols * grid.cell_m - float(enu_m[0])
    beside_north, beside_east = (np.maximum(0, np.abs(d) - grid.cell_m / 2) for d in (north, east))
    nearest_m = np.hypot(beside_north, beside_east)
    east, north = np.broadcast_arrays(east, north)
    plane = _plane(east, north, height, (state == SAFE) & (nearest_m < plane_m))
    return Around(nearest_m, state, slope, top - plane)


def _plane(east: Floats, north: Floats, height: Floats, ground: Flags) -> Floats:
    """Return the least-squares plane of the ground, NaN without enough of it."""
    use = ground & np.isfinite(height)
    if int(use.sum()) < LEAST_GROUND:
        return np.full(height.shape, np.nan)
    design = np.column_stack([np.ones(int(use.sum())), east[use], north[use]])
    level, a, b = np.linalg.lstsq(design, height[use], rcond=None)[0]
    return np.asarray(level + a * east + b * north)


def _lacking(around: Around, area: Flags, parameters: Parameters) -> str:
    """Return why ground is not safe all over an area: the nearest reason."""
    lacking = area & (around.state != SAFE)
    if not lacking.any():
        return ""
    cell = _nearest(around, lacking)
    away_m = float(around.nearest_m[cell])
    if around.state[cell] == UNKNOWN:
        return f"not seen at {away_m:.1f} m"
    # A footprint about an unsafe cell reaches to what makes it so.
    reach_m = away_m + parameters.footprint_m
    raised = (around.over_m > parameters.relief_m) & (around.nearest_m <= reach_m)
    if raised.any():
        return _height(around, raised)
    slope_deg = float(around.slope_deg[cell])
    if slope_deg >= parameters.safe_slope_deg:
        return f"slope {slope_deg:.0f} deg at {away_m:.1f} m"
    return f"uneven at {away_m:.1f} m"


def _obstructed(around: Around, area: Flags) -> str:
    """Return what stands in an area, or that it was not all seen."""
    raised = area & (around.over_m > HIGHEST_OBJECT_M)
    if raised.any():
        return _height(around, raised)
    unseen = area & np.isnan(around.over_m) & (around.state != SAFE)
    return f"not seen at {float(around.nearest_m[_nearest(around, unseen)]):.1f} m" if unseen.any() else ""


def _height(around: Around, raised: Flags) -> str:
    cell = _nearest(around, raised)
    return f"{float(around.over_m[cell]):.1f} m high at {float(around.nearest_m[cell]):.1f} m"


def _nearest(around: Around, cells: Flags) -> tuple[int, int]:
    row, col = np.unravel_index(int(np.where(cells, around.nearest_m, np.inf).argmin()), cells.shape)
    return int(row), int(col)
