"""Near and far map of one map frame."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame
from slz.window import Window

Points = NDArray[np.float64]
M = TypeVar("M")


@dataclass(frozen=True, slots=True)
class MapFrame(LocalFrame):
    """Frame of one map.

    number: differs between successive maps with the same origin, as after a jump of the position estimate.
    """

    number: int

    @classmethod
    def of(cls, frame: LocalFrame, number: int) -> MapFrame:
        return cls(frame.lat_deg, frame.lon_deg, frame.alt_m, number)


class MapPair(Generic[M]):
    """Near and far map of the present frame (SLZ paper, section 3.1.2).

    Both maps, and all later ones, take the IDs of their zones from one counter.

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
