"""Method: from a window of points to the zones of a near and a far map, by one set of rules."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.adaptive import Choice
from slz.frame import MapFrame
from slz.landing_point.corridors import Corridors
from slz.landing_point.judgement import SelectedPoint
from slz.landing_point.watched_ground import WatchedGround
from slz.report import MapReport, Report
from slz.terrain.terrain import Tally
from slz.terrain.terrain_view import DisplayedTerrain
from slz.window import Window
from slz.wires.detected_wire import Wire
from slz.zone import Zone

Points = NDArray[np.float64]


class ResolutionMap(Protocol):
    """Map of one resolution: terrain, and the zones found in it."""

    zones: tuple[Zone, ...]
    n_without_tile: int
    n_evicted: int

    @property
    def terrain(self) -> DisplayedTerrain: ...

    @property
    def tally(self) -> Tally | None:
        """Numbers of cells of the last window, None in source mode."""


@dataclass(frozen=True, slots=True)
class MethodResult:
    """Outcome of one window.

    n_used: points near enough for the near map. wires: known now. n_alone: returns without others near.
    """

    near: ResolutionMap
    far: ResolutionMap
    choice: Choice
    n_used: int
    wires: tuple[Wire, ...] = ()
    n_alone: int = 0


class Method(Protocol):
    """Rules of the sources, or safer ones."""

    @property
    def report(self) -> type[Report]:
        """Class of the reports."""

    @property
    def maps(self) -> tuple[ResolutionMap, ResolutionMap] | None:
        """Near and far map, None before the first window."""

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from the next window on; those that shape a map are unchanged."""

    def process(
        self, window: Window, frame: MapFrame, selected: SelectedPoint | None, ms: dict[str, float]
    ) -> MethodResult:
        """Run the stages from points to zones on a window in a map frame, and add their times to `ms`.

        The evidence at the selected point is kept.
        """

    def without_map(self, enu_m: Points, before: SelectedPoint | None) -> SelectedPoint:
        """Return the state of a selected point that neither map has."""

    def corridors(self, enu_m: Points) -> Corridors | None:
        """Return the ways in and out of a point (3,), None where this method judges none."""

    def watched_ground(self, enu_m: Points) -> WatchedGround | None:
        """Return the near map's ground at a point (3,) to compare scans with, None for none."""

    def prior_report(self) -> MapReport | None:
        """Return the zones of ground surveyed before the flight, None without."""


def centre_of(first_point: Points, window: Window) -> tuple[float, float]:
    """Return where to centre maps: at the first (0 or 1, 3) point (SLZ paper, 3.1.2), else at the sensor."""
    at = next(iter(first_point), np.nan_to_num(window.sensor_enu_m, posinf=0, neginf=0))
    return float(at[0]), float(at[1])
