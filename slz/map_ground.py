"""Ground: all that the default method knows of one map frame, made in one constructor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.adaptive import COARSEST, Adapter, Choice
from slz.air.seen_air import SeenAir
from slz.frame import MapFrame
from slz.grid import Edges
from slz.landing_point.corridors import Corridors, corridors
from slz.prior import Prior
from slz.surface.surface_map import SurfaceMap
from slz.terrain.arrivals import Arrivals
from slz.terrain.tiles import Tiles
from slz.wires.detected_wire import Wire
from slz.wires.wire_detector import WireDetector, WireMarks
from slz.zones.zone_map import ZoneMap

Points = NDArray[np.float64]
UNDECIDED = Choice(0.0, math.nan, 0.0, False, COARSEST, math.nan)  # before the first window


class Ground:
    """Maps and memories of one map frame; a new frame is a new ground.

    Parameters
    ----------
    frame
        The map frame.
    centre_enu_m
        East and north of the centre of both maps (SLZ paper, section 3.1.2).
    numbers
        IDs for zones, of both maps and of all later grounds.
    prior
        Ground surveyed before the flight, None without.

    Attributes
    ----------
    parameters
        Of the present window.
    near, far
        The maps of fine and of coarse cells, with their zones.
    surface, air, arrivals, wires, marks
        Kinds of surface; air that rays passed; what has come to stand on known ground; wires, and the points
        that mark them on the maps. In stored heights, over `datum_m`.
    choice
        Of the last window.
    now_s
        Time of the present window since the first one.
    altered_by_surface_m, altered_by_wires_m
        Edges of the places where they change the maps without any return of the present window.
    pinned_enu_m
        The selected landing point, whose evidence is kept; None for none.
    """

    def __init__(
        self,
        frame: MapFrame,
        centre_enu_m: tuple[float, float],
        parameters: Parameters,
        numbers: Iterator[int],
        prior: Prior | None = None,
    ) -> None:
        self.frame, self.parameters, self.prior = frame, parameters, prior
        self.near = ZoneMap(parameters, centre_enu_m, numbers)
        self.far = ZoneMap(far_parameters(parameters), centre_enu_m, numbers)
        west_m, south_m = self.tiles.west_m, self.tiles.south_m
        self.surface = SurfaceMap(west_m, south_m, parameters)
        self.arrivals = Arrivals(west_m, south_m, parameters)
        self.air = SeenAir(parameters)
        self.wires, self.marks = WireDetector(parameters, self.air), WireMarks()
        for zone_map in (self.near, self.far):
            zone_map.terrain.surface, zone_map.terrain.arrivals = self.surface, self.arrivals
        self.adapter = Adapter(parameters)
        self.choice = UNDECIDED
        self.now_s = 0.0
        self.altered_by_surface_m: list[Edges] = []
        self.altered_by_wires_m: list[Edges] = []
        self.pinned_enu_m: Points | None = None

    @property
    def tiles(self) -> Tiles:
        """Evidence of the near map."""
        return self.near.tiles

    @property
    def datum_m(self) -> float:
        """Height of the zero of the stored heights in the map frame."""
        return self.near.tiles.datum_m

    def begin_window(self, stamp_s: float, pinned_enu_m: Points | None) -> None:
        """Advance to a window: its time, and the point whose evidence is kept."""
        self.now_s, self.pinned_enu_m = self.tiles.now_s(stamp_s), pinned_enu_m

    def use(self, parameters: Parameters) -> None:
        """Use other parameters that shape no map from the next window on."""
        self.parameters = parameters
        self.near.use(parameters)
        self.far.use(far_parameters(parameters))

    def stored(self, enu_m: Points) -> Points:
        """Return places (..., 3) of the map frame in stored heights."""
        return np.asarray(enu_m - np.array([0.0, 0.0, self.datum_m]))

    def known_wires(self) -> tuple[Wire, ...]:
        """Return the wires known now, in the map frame."""
        return self.wires.wires(self.datum_m)

    def corridors(self) -> Callable[[Points], Corridors]:
        """Return what judges the ways in and out of a point (3,)."""
        wires = self.marks.points_m + np.array([0.0, 0.0, self.datum_m])
        near, far = self.near.terrain, self.far.terrain
        return lambda enu_m: corridors(enu_m, near, far, self.air, self.parameters, wires)


def far_parameters(parameters: Parameters) -> Parameters:
    """Return the parameters of the far map.

    The evidence has cells a quarter of `far_cell_m` wide, from which coarser levels are derived; a footprint
    spans three cells at least, gaps of a cell count as seen, the limit on a zone's boundary follows the cell,
    and neither gear nor rotor, tail and D are judged, so that the far map finds where it is worth looking
    closer. What it calls safe is no place to land before the near map says so too.
    """
    p = parameters
    cell_m = max(p.far_cell_m / 2**COARSEST, p.cell_m)
    return p.model_copy(
        update={
            "cell_m": cell_m,
            "coverage_m": max(p.coverage_m, p.far_cell_m),
            "min_square_m": max(p.min_square_m, p.far_cell_m),
            "min_boundary_points": max(1, int(p.min_boundary_points * p.cell_m / cell_m)),
            "height_noise_m": 2 * p.height_noise_m,
            "gear": "none",
            "rotor_diameter_m": 0.0,
            "tail_length_m": 0.0,
            "d_value_m": 0.0,
            "memory_mb": p.memory_mb / 8,
        }
    )
