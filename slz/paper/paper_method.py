"""Paper method: the rules of the SLZ paper to the letter, unsafe ones included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.adaptive import Adapter, Choice
from slz.grid import Grid
from slz.landing_point.judgement import SelectedPoint, unknown
from slz.map_pair import MapPair
from slz.method import MethodResult
from slz.paper.paper_map import PaperMap
from slz.paper.window_cells import Returns
from slz.report import MapReport
from slz.stage_clock import StageClock
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

    fills_contours = True

    def __init__(
        self, parameters: Parameters, centre_enu_m: tuple[float, float] | None, follow: bool
    ) -> None:
        self._p = parameters
        self._follow = follow
        far = parameters.model_copy(update={"cell_m": parameters.far_cell_m})
        self._pair = MapPair(
            lambda centre, numbers: PaperMap(parameters, centre, numbers),
            lambda centre, numbers: PaperMap(far, centre, numbers),
            centre_enu_m,
        )
        self._adapter = Adapter(parameters)
        self._returns = Returns()
        self._far_was_active = False

    @property
    def maps(self) -> tuple[PaperMap, PaperMap] | None:
        """Near and far map, None before the first window."""
        return self._pair.maps

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from the next window on; none that the sources' rules read may change."""
        self._p = parameters

    def process(
        self, window: Window, sensor_enu_m: Points, selected: SelectedPoint | None, clock: StageClock
    ) -> MethodResult:
        """Run outlier removal, the choice of the map, terrain and zones on a window."""
        if self._pair.is_new(window):
            self._adapter, self._far_was_active = Adapter(self._p), False
            self._pair.create_maps(window, lambda: self._read(window, sensor_enu_m, ANYWHERE).kept()[:1])
        near, far = self._pair.maps_now
        guess = far if self._far_was_active else near
        returns = self._read(window, sensor_enu_m, guess.terrain.grid)
        clock.lap("outliers")
        choice = self._adapter.choose_from_cells(window, returns)
        active = far if choice.far else near
        if active is not guess:
            returns = self._read(window, sensor_enu_m, active.terrain.grid)
        clock.lap("choice")
        outside = returns.first_outside() if self._follow else None
        if outside is not None:
            active.move(*outside)
            returns = self._read(window, sensor_enu_m, active.terrain.grid)
        n_used = active.fuse(returns)
        clock.lap("terrain")
        near.detect_zones(sensor_enu_m)
        far.detect_zones(sensor_enu_m)
        clock.lap("zones")
        self._far_was_active = choice.far
        return MethodResult(near, far, choice, n_used)

    def without_map(self, enu_m: Points, before: SelectedPoint | None) -> SelectedPoint:
        """Return the last state of a point that both windows left behind (SLZ thesis, section 4.3.2.2)."""
        return unknown(enu_m) if before is None else replace(before, judged_by="none", zone_id=None)

    def corridors(self, enu_m: Points) -> None:
        """Return None: the sources leave the way in to the pilot."""

    def watched_ground(self, enu_m: Points) -> None:
        """Return None: the sources judge by windows of a second alone."""

    def far_is_active(self, choice: Choice) -> bool:
        """Tell whether the far map was chosen (SLZ thesis, section 4.3.1)."""
        return choice.far

    def prior_report(self) -> MapReport | None:
        """Return None: the sources know no ground surveyed before the flight."""
        return None

    def _read(self, window: Window, sensor_enu_m: Points, grid: Grid) -> Returns:
        """Place a window's returns in a grid and drop the outliers among them (SLZ paper, section 3.2.1)."""
        p = self._p
        self._returns.read(window.points_enu_m, sensor_enu_m, p.max_range_m, grid)
        self._returns.keep_heights(p.histogram_bins, p.histogram_threshold)
        return self._returns
