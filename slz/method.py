"""Method: from a window of points to the zones of a near and a far map, by one set of rules."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from slz.adaptive import Choice
from slz.frame import LocalFrame
from slz.landing_point.judgement import SelectedPoint
from slz.report import MapReport
from slz.stage_clock import StageClock
from slz.terrain.terrain_view import DisplayedTerrain
from slz.window import Window
from slz.zone import Zone

Points = NDArray[np.float64]


class ResolutionMap(Protocol):
    """Map of one resolution: terrain, and the zones found in it."""

    zones: tuple[Zone, ...]
    n_without_tile: int
    n_evicted: int

    @property
    def terrain(self) -> DisplayedTerrain: ...

    def zone_at(self, enu_m: Points) -> int | None:
        """Return the ID of the zone that holds a point."""


@dataclass(frozen=True, slots=True)
class MethodResult:
    """Outcome of one window.

    n_used: points near enough for the near map.
    """

    near: ResolutionMap
    far: ResolutionMap
    choice: Choice
    n_used: int


class Method(Protocol):
    """Rules of the sources, or safer ones."""

    fills_contours: bool
    """Whether zones hold everything inside their contour, or safe cells only."""

    @property
    def maps(self) -> tuple[ResolutionMap, ResolutionMap] | None:
        """Near and far map, None before the first window."""

    def process(
        self, window: Window, sensor_enu_m: Points, selected: SelectedPoint | None, clock: StageClock
    ) -> MethodResult:
        """Run the stages from points to zones on a window; keep the evidence at the selected point."""

    def without_map(self, enu_m: Points, before: SelectedPoint | None) -> SelectedPoint:
        """Return the state of a selected point that neither map has."""

    def far_is_active(self, choice: Choice) -> bool:
        """Tell whether the far map's zones are the report's `zones`."""

    def prior_report(self) -> MapReport | None:
        """Return the zones of ground surveyed before the flight, None without."""


M = TypeVar("M")


class MapPair(Generic[M]):
    """Near and far map of the present frame (SLZ paper, section 3.1.2).

    Parameters
    ----------
    near, far
        Make a map from its centre and the counter of zone IDs.
    centre_enu_m
        East and north of the first window's centre; None takes the first point.
    """

    def __init__(
        self,
        near: Callable[[tuple[float, float], Iterator[int]], M],
        far: Callable[[tuple[float, float], Iterator[int]], M],
        centre_enu_m: tuple[float, float] | None,
    ) -> None:
        self._make = near, far
        self._centre = centre_enu_m
        self._numbers = itertools.count(1)
        self._frame: LocalFrame | None = None
        self.maps: tuple[M, M] | None = None

    @property
    def maps_now(self) -> tuple[M, M]:
        """Near and far map of the present frame.

        Raises
        ------
        RuntimeError
            Before the first window.
        """
        if self.maps is None:
            raise RuntimeError("no window was processed yet")
        return self.maps

    def is_new(self, window: Window) -> bool:
        """Tell whether a window is in another frame than the maps."""
        return self.maps is None or window.frame != self._frame

    def create_maps(self, window: Window, first_point: Callable[[], Points]) -> tuple[M, M]:
        """Create both maps in a window's frame, at the first (0 or 1, 3) point, else at the sensor."""
        self._frame = window.frame
        centre = self._centre
        if centre is None:
            first = next(iter(first_point()), np.nan_to_num(window.sensor_enu_m, posinf=0, neginf=0))
            centre = float(first[0]), float(first[1])
        near, far = (make(centre, self._numbers) for make in self._make)
        self.maps = near, far
        return near, far
