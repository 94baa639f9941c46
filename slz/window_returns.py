"""Returns: the rows of one window while the stages of the default method work on them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntFlag
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slz.frame import is_known
from slz.kernels.points.rows import picked, rows_of
from slz.window import Window

Points = NDArray[np.float64]
Rows = NDArray[np.int64]


class Flag(IntFlag):
    """Properties of a return; the column `flags` holds sums of these.

    USABLE: finite, in range. KEPT: no outlier rule drops it. SPARSE: kept although isolated, since most
    returns of the window are; not for the near map. NEAR: near enough to be mapped. ISOLATED: few others are
    around; judged together with those of other windows. DISTANT: isolated, and too far to be judged; perhaps
    of a wire. RAISED: above known ground of the near map. APART: of what has come to stand there, and so no
    evidence.
    """

    USABLE = 1
    KEPT = 2
    SPARSE = 4
    NEAR = 8
    ISOLATED = 16
    DISTANT = 32
    RAISED = 64
    APART = 128


@dataclass(slots=True, eq=False)
class Returns:
    """Rows of a window, in the order of their scans: one a return, made once and worked on in place.

    window: whence they come. places_m: (n, 3) float64, from the stage of registration on in stored heights.
    flags: (n,) uint16, sums of `Flag`. sensor_m: (3,) position of the sensor at the end, NaN where unknown;
    in the frame's heights. added_m: (m, 3) evidence beside the rows, in stored heights.
    """

    window: Window
    places_m: Points
    flags: NDArray[np.uint16]
    sensor_m: Points
    added_m: Points = field(default_factory=lambda: np.empty((0, 3)))

    @classmethod
    def of(cls, window: Window) -> Self:
        """Return the rows of a window, before anything is known of them."""
        flags = np.zeros(len(window), np.uint16)
        return cls(window, np.array(window.points_enu_m, order="C"), flags, window.sensor_known_m)

    def __len__(self) -> int:
        return len(self.flags)

    @property
    def stamp_s(self) -> float:
        """Time of the newest return."""
        return self.window.end_ns * 1e-9

    @property
    def has_place(self) -> bool:
        """True if the sensor's position at the end of the window is known."""
        return is_known(self.sensor_m)

    def rows(self, has: int, lacks: int = 0) -> Rows:
        """Return the rows that have all flags of one sum, and none of another."""
        return rows_of(self.flags, int(has), int(lacks))  # plain numbers, whose type Numba finds fastest

    def places(self, has: int, lacks: int = 0) -> Points:
        """Return a copy (m, 3) of the places of such rows."""
        return picked(self.places_m, self.flags, int(has), int(lacks))


def is_for_near_map(flags: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Return which flags (n,) are of returns for the near map: near enough, or raised at any range."""
    near = (flags & (Flag.KEPT | Flag.NEAR | Flag.SPARSE)) == Flag.KEPT | Flag.NEAR
    return np.asarray(near | ((flags & Flag.RAISED) != 0))


def is_alone(flags: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Return which flags (n,) are of returns without enough others near them."""
    return np.asarray((flags & (Flag.ISOLATED | Flag.DISTANT | Flag.SPARSE)) != 0)
