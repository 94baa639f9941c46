"""Paper method: the rules of the SLZ paper to the letter, unsafe ones included."""

from __future__ import annotations

import itertools
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
from slz.paper.paper_map import PaperMap
from slz.paper.paper_report import PaperReport
from slz.paper.window_cells import WindowCells
from slz.report import MapReport
from slz.window import Window

Points = NDArray[np.float64]
ANYWHERE = Grid(0.0, 0.0, 1.0, 1, 1)


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
