"""State of the selected landing point (SLP; SLZ thesis, section 4.3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.landing_point.corridors import Corridors
from slz.landing_point.surroundings import Surroundings, cell_of, ground_m, surroundings
from slz.landing_point.watched_ground import WatchedGround
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.footing import ANY_FOOTING, Footing
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.terrain.terrain_view import TerrainView

Judge = Literal["near", "far", "none"]


class PointState(Enum):
    """State of a selected point."""

    SAFE = "safe"
    UNSAFE = "unsafe"
    UNKNOWN = "unknown"


STATES = {
    int(SAFE): PointState.SAFE,
    int(UNSAFE): PointState.UNSAFE,
    int(UNKNOWN): PointState.UNKNOWN,
}


@dataclass(frozen=True, slots=True)
class SelectedPoint:
    """State of the selected landing point after a window.

    judged_by: the map that decided; "none" when neither covers the point: the state is then the last one
    known (SLZ thesis, section 4.3.2.2), or unknown if there was none. height_m: height of the ground at the
    point. slope_deg, relief_m: of the footprint at the point, NaN where unknown. certainty: the least of the
    cells within the touchdown error, in source mode that of the point's cell. surroundings: None where
    nothing is known. footing: headings at which the gear stands there, and how likely a
    hazard went unseen. surface: what the ground there is. corridors: ways in and out, None where they were
    not judged. ground: to watch between windows, None where the near map has none.
    """

    enu_m: NDArray[np.float64]
    state: PointState
    judged_by: Judge
    height_m: float
    slope_deg: float
    relief_m: float
    certainty: float
    zone_id: int | None
    surroundings: Surroundings | None
    footing: Footing = ANY_FOOTING
    surface: SurfaceHere = UNKNOWN_SURFACE
    corridors: Corridors | None = None
    ground: WatchedGround | None = None


def judge_point(
    enu_m: NDArray[np.float64], near: TerrainView, far: TerrainView, parameters: Parameters
) -> SelectedPoint | None:
    """Judge a selected point anew; None where neither map has it.

    Where the near map has it, that one decides, else the far map (SLZ thesis, section 4.3.2.3). In default
    mode the point is safe only when every cell within the touchdown error is safe, and the gear stands on all
    of them at some heading.
    """
    maps: tuple[tuple[Judge, TerrainView], ...] = (("near", near), ("far", far))
    for name, terrain in maps:
        state = terrain.state_at(enu_m, parameters.touchdown_error_m)
        if state is not None:
            cell, footing = cell_of(enu_m, terrain), terrain.footing_at(enu_m, parameters.touchdown_error_m)
            if state == SAFE and not footing.headings_deg:
                state = int(UNSAFE)
            return SelectedPoint(
                enu_m=enu_m,
                state=STATES[state],
                judged_by=name,
                height_m=ground_m(terrain, cell),
                slope_deg=float(terrain.layer("slope_deg", cell)[0, 0]),
                relief_m=float(terrain.layer("relief_m", cell)[0, 0]),
                certainty=terrain.certainty_at(enu_m, parameters.touchdown_error_m),
                zone_id=None,
                surroundings=surroundings(enu_m, terrain, parameters),
                footing=footing,
                surface=terrain.surface_at(enu_m, parameters.touchdown_error_m + parameters.footprint_m / 2),
            )
    return None


def unknown(enu_m: NDArray[np.float64], height_m: float = math.nan) -> SelectedPoint:
    """Return the state of a point that no map covers."""
    nan = math.nan
    return SelectedPoint(enu_m, PointState.UNKNOWN, "none", height_m, nan, nan, nan, None, None)
