"""Default method: evidence of all windows and plane fits, with allowance for errors of ranges and poses."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.frame import MapFrame
from slz.landing_point.corridors import Corridors
from slz.landing_point.judgement import SelectedPoint, unknown
from slz.landing_point.watched_ground import WatchedGround, watched_ground
from slz.lanes import Lanes
from slz.map_ground import Ground
from slz.method import MethodResult, centre_of
from slz.prior import Prior
from slz.prior import Source as PriorSource
from slz.report import MapReport, Report
from slz.stages import BELIEF, METHOD
from slz.window import Window
from slz.window_returns import Flag, Returns, is_alone, is_for_near_map
from slz.zones.zone_map import ZoneMap

Points = NDArray[np.float64]


class DefaultMethod:
    """Safer rules than the sources'; see `docs/sources.md` for each departure.

    Parameters
    ----------
    centre_enu_m
        East and north of the first window's centre; None takes the first point.
    threads
        With 2 some stages run beside others; the results are the same.
    prior
        Gives ground surveyed before the flight, see `slz.prior`.
    """

    report = Report

    def __init__(
        self,
        parameters: Parameters,
        centre_enu_m: tuple[float, float] | None,
        threads: int,
        prior: PriorSource | None,
    ) -> None:
        self._p = parameters
        self._lanes = Lanes(threads)
        self._centre, self._numbers = centre_enu_m, itertools.count(1)
        self.prior = None if prior is None else Prior(prior, parameters)
        self.ground: Ground | None = None

    @property
    def maps(self) -> tuple[ZoneMap, ZoneMap] | None:
        """Near and far map, None before the first window."""
        return None if self.ground is None else (self.ground.near, self.ground.far)

    def use(self, parameters: Parameters) -> None:
        """Use other parameters that shape no map from the next window on."""
        self._p = parameters
        for user in (self.ground, self.prior):
            if user is not None:
                user.use(parameters)

    def process(
        self, window: Window, frame: MapFrame, selected: SelectedPoint | None, ms: dict[str, float]
    ) -> MethodResult:
        """Run all stages on a window."""
        returns = Returns.of(window)
        self._lanes.run(BELIEF, returns, self._p, ms)
        ground = self.ground
        if ground is None or ground.frame != frame:
            centre = self._centre or centre_of(returns.places(Flag.KEPT)[:1], window)
            ground = self.ground = Ground(frame, centre, self._p, self._numbers, self.prior)
        ground.begin_window(returns.stamp_s, None if selected is None else selected.enu_m)
        self._lanes.run(METHOD, returns, ground, ms)
        n_used, n_alone = (int(of(returns.flags).sum()) for of in (is_for_near_map, is_alone))
        return MethodResult(ground.near, ground.far, ground.choice, n_used, ground.known_wires(), n_alone)

    def without_map(self, enu_m: Points, before: SelectedPoint | None) -> SelectedPoint:
        """Return an unknown point: evidence that neither map has is too old, or was given up."""
        return unknown(enu_m, math.nan if before is None else before.height_m)

    def corridors(self, enu_m: Points) -> Corridors | None:
        """Return the ways in and out of a point (3,)."""
        return None if self.ground is None else self.ground.corridors()(enu_m)

    def watched_ground(self, enu_m: Points) -> WatchedGround | None:
        """Return the near map's ground at a point (3,) to compare scans with, None before any window."""
        return None if self.ground is None else watched_ground(enu_m, self.ground.near.terrain, self._p)

    def prior_report(self) -> MapReport | None:
        """Return the zones of ground surveyed before the flight, None without."""
        grid = None if self.prior is None else self.prior.grid
        return None if self.prior is None or grid is None else MapReport(grid, self.prior.zones)
