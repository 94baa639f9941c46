"""Arrivals on known ground: kept apart from the evidence, until rays prove that they have gone.

Evidence keeps a hazard for `hold_s` against newer returns, since a ray beside a thin object proves nothing.
What rises over ground that was seen before, such as people and cars, is therefore kept in columns of its own.
It counts as an obstacle at once. A column is given up when rays prove it empty:

- Nothing was returned since by it or by the columns within `AROUND_M`.
- Rays passed through it and those around, from where and from as near as the rays that they returned
  (`slz.kernels.air.passing_rays`): enough that none would have been returned with a probability below
  `FALSE_ALARM`. The share of rays that they return is taken as `CAUTION` times its lower bound at 95 %
  (Clopper and Pearson, 1934).
- The same is true of the scans to which these rays belong, since the rays of one scan are not independent: a
  sensor that scans in lines sends all rays of a line beside an object.

A wire that returned one ray of thirty is thus given up after 6,000 rays through 0.8 m around it, and a person
after thirty. What stands for longer than the evidence is kept, or than memory allows, becomes evidence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import betaincinv

from params import Parameters
from slz.column_table import ColumnTable
from slz.kernels.air.passing_rays import (
    BASE,
    EAST,
    FARTHER,
    FIELDS,
    RANGE,
    RETURNED,
    SAME_SIDE,
    SCANS_RETURNED,
    SCANS_SINCE,
    SINCE,
    TOP,
    UP,
    are_beside,
    count_passing,
    sums_around,
)

SAME_M = 0.7  # over what stands in a column, up to which an isolated return may be its
AROUND_M = 0.4  # around a column, in which other returns are of the same object
FEET_M = 0.1  # over known ground, from which returns around a column are of what stands there
FALSE_ALARM, DOUBT = 1e-3, 0.05
FOOT_M = 0.05  # more than the relief limit that the ground was lower when it came
OWN = 2.0  # rays that passed the column itself
CAUTION = 0.7  # of the share's lower bound, for what is seen a little differently from one window to the next
STAYS = 0.5  # of `max_age_s`, for which what stands is kept apart
MOST, MOST_AFAR = 8192, 65536  # columns around the sensor, and elsewhere
MOST_SIDE = 500  # columns along the side of the box around the sensor
MOST_RAYS = 30_000  # of a window that are followed

Points = NDArray[np.float64]
Flags = NDArray[np.bool_]
DIRECTION = slice(EAST, UP + 1)


@dataclass(slots=True)
class _Columns(ColumnTable):
    """Columns, by row and column from the evidence's corner.

    records: see `slz.kernels.air.passing_rays`. since_s: when the first return came. highest, lowest: (m, 3).
    gone: those proven empty, which count as long as others around are not.
    """

    cells: NDArray[np.int64]
    records: Points
    since_s: Points
    highest: Points
    lowest: Points
    gone: Flags

    @classmethod
    def none(cls) -> _Columns:
        cells, records = np.empty((0, 2), np.int64), np.empty((0, FIELDS))
        return cls(cells, records, np.empty(0), np.empty((0, 3)), np.empty((0, 3)), np.empty(0, bool))

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def points(self) -> Points:
        """Highest and lowest returns (n, 3) of what stands."""
        return np.concatenate([self.highest[~self.gone], self.lowest[~self.gone]])


class Arrivals:
    """Columns in which something stands that was not there before.

    Parameters
    ----------
    west_m, south_m
        Corner from which columns are counted; they are as wide as the near map's cells.

    Attributes
    ----------
    points_enu_m, altered_enu_m
        (n, 3) highest return of each column, and the ground that was known to be below its lowest one: what
        stands is unsafe where that ground has grown too old. And those that are new or have gone since the
        last window. In the heights of the evidence.
    """

    def __init__(self, west_m: float, south_m: float, parameters: Parameters) -> None:
        self._west_m, self._south_m, self._cell_m = west_m, south_m, parameters.cell_m
        self._stays_s, self._least_m = STAYS * parameters.max_age_s, parameters.relief_m + FOOT_M
        self._around = math.ceil(AROUND_M / parameters.cell_m)
        # The map's grid holds all that is within a quarter of its side of the sensor.
        self._reach = min(MOST_SIDE // 2, max(1, int(parameters.zone_m / 4 / parameters.cell_m) - 1))
        self._held = _Columns.none()
        self.points_enu_m: Points = np.empty((0, 3))
        self.altered_enu_m: Points = np.empty((0, 3))

    def __len__(self) -> int:
        """Number of columns in which something stands."""
        return len(self._held) - int(self._held.gone.sum())

    def update(
        self,
        points_enu_m: Points,
        raised: Flags,
        over: Flags,
        isolated: Flags,
        origin: NDArray[np.uint16],
        origins_enu_m: Points,
        sensor_enu_m: Points,
        now_s: float,
    ) -> tuple[Flags, Points]:
        """Take a window; return its returns that are no evidence, and those of what is so from now on.

        No evidence is what stands in the columns, down to its feet in those beside them; evidence from now on
        are the highest and lowest returns of what has stood for long.

        Parameters
        ----------
        points_enu_m, raised
            (n, 3) returns in the order of their scans, and (n,) which of them are higher over known ground
            than noise and a height explain, with lower ground on all sides; in the heights of the evidence.
        over
            (n,) which of them are more than `FEET_M` and noise over known ground: around a column they are
            its own, whatever is beside them.
        isolated
            (n,) which of them have few others around them. Alone they are no arrival.
        origin, origins_enu_m
            (n,) the scan of each return, and (k, 3) the sensor's position in each scan, likewise; NaN where
            its rays prove nothing, such as a radar's.
        sensor_enu_m
            (3,) east, north and up of the last scan.
        """
        before = self.points_enu_m
        origins = np.ascontiguousarray(origins_enu_m)
        here = self._cells_of(sensor_enu_m[np.newaxis])
        raised, up = raised.copy(), np.flatnonzero(raised)
        raised[up] = self._within_reach(self._cells_of(points_enu_m[up]), here)
        near = self._within_reach(self._held.cells, here)
        self._held, afar = self._held.some(near), self._held.some(~near)
        self._add(points_enu_m, raised & ~isolated, origin, origins, now_s)
        beside = self._beside(points_enu_m, self._around, SAME_M)
        raised = raised & (~isolated | beside)
        self._add(points_enu_m, raised & isolated, origin, origins, now_s)
        beside = self._beside(points_enu_m, self._around, SAME_M)
        below = self._beside(points_enu_m, 1, math.inf) & ~isolated
        apart = raised | (over & beside) | below
        settled = self._settled(now_s)
        evidence, self._held = self._held.some(settled).points, self._held.some(~settled)
        if len(self._held):
            place, index = self._index()
            stride = max(1, math.ceil(len(points_enu_m) / MOST_RAYS))
            rays = points_enu_m, origin, origins, raised, stride
            count_passing(*rays, *place, self._around, index, self._held.records)
            self._held.gone |= self._proven_empty(index)
            self._held = self._held.some(~self._is_over(index))
        self._held = self._held.joined_with(
            afar.some(np.argsort(np.argsort(-afar.since_s, kind="stable")) < MOST_AFAR)
        )
        standing = self._held.some(~self._held.gone)
        ground = standing.lowest - (0.0, 0.0, self._least_m)
        self.points_enu_m = np.concatenate([standing.highest, ground])
        self.altered_enu_m = _in_one_only(before, self.points_enu_m)
        return apart, evidence

    def _cells_of(self, points: Points) -> NDArray[np.int64]:
        """Return row and column (n, 2) of points (n, 3)."""
        return np.floor((points[:, 1::-1] - (self._south_m, self._west_m)) / self._cell_m).astype(np.int64)

    def _within_reach(self, cells: NDArray[np.int64], here: NDArray[np.int64]) -> Flags:
        within: Flags = (np.abs(cells - here) <= self._reach).all(axis=1)
        return within

    def _add(
        self, points: Points, which: Flags, origin: NDArray[np.uint16], origins: Points, now_s: float
    ) -> None:
        if which.any():
            self._held = self._with(points[which], origins[origin[which]], now_s)

    def _beside(self, points: Points, around: int, upward_m: float) -> Flags:
        """Return which points (n, 3) are in the columns, or within a number of columns beside them.

        They are no more than `upward_m` over what stands there.
        """
        if not len(self._held):
            return np.zeros(len(points), bool)
        place, index = self._index()
        index[index >= 0] = np.where(self._held.gone[index[index >= 0]], -1, index[index >= 0])
        return are_beside(points, *place, around, upward_m, index, self._held.records)

    def _with(self, points: Points, sensor: Points, now_s: float) -> _Columns:
        """Return the columns with those of further returns (n, 3), seen from (n, 3)."""
        held = self._held
        at = self._cells_of(points)
        cells, own = np.unique(np.concatenate([held.cells, at]), axis=0, return_inverse=True)
        was, new = own.ravel()[: len(held)], own.ravel()[len(held) :]
        count = np.bincount(new, minlength=len(cells))
        hit = count > 0
        records, since_s = np.zeros((len(cells), FIELDS)), np.full(len(cells), now_s)
        records[:, BASE], records[:, TOP] = np.inf, -np.inf
        highest, lowest = np.full((2, len(cells), 3), np.nan)
        gone = np.zeros(len(cells), bool)
        stays = ~(held.gone & hit[was])  # what comes to an empty column is new
        was = was[stays]
        records[was], since_s[was], gone[was] = held.records[stays], held.since_s[stays], held.gone[stays]
        highest[was], lowest[was] = held.highest[stays], held.lowest[stays]

        way = points - sensor
        range_m = np.linalg.norm(way, axis=1)
        mean = np.column_stack(
            [np.bincount(new, weights, len(cells)) for weights in (way / range_m[:, None]).T]
        )
        mean[hit] = mean[hit] / np.linalg.norm(mean[hit], axis=1, keepdims=True)
        range_m = np.bincount(new, range_m, len(cells)) / np.maximum(count, 1)
        turned = hit & ~(np.einsum("ij,ij->i", mean, records[:, DIRECTION]) >= SAME_SIDE)
        farther, nearer = range_m > FARTHER * records[:, RANGE], records[:, RANGE] > FARTHER * range_m
        moved = hit & (farther | nearer)
        # Seen from another side, or from farther, it may return another share of the rays.
        records[turned | moved, RETURNED : SCANS_SINCE + 1] = 0.0
        records[hit, DIRECTION], records[hit, RANGE] = mean[hit], range_m[hit]

        own = np.flatnonzero(hit)
        order = np.lexsort((points[:, 2], new))
        first = np.searchsorted(new[order], own)
        for extreme, field, at in ((lowest, BASE, first), (highest, TOP, first + count[hit] - 1)):
            best = points[order[at]]
            beyond = best[:, 2] > records[own, TOP] if field == TOP else best[:, 2] < records[own, BASE]
            extreme[own[beyond]], records[own[beyond], field] = best[beyond], best[beyond, 2]
        return _Columns(cells, records, since_s, highest, lowest, gone)

    def _settled(self, now_s: float) -> Flags:
        """Return which columns are evidence from now on: the oldest, and those beyond what is kept.

        None that is far from the sensor: the map's grid may not hold it now.
        """
        held = self._held
        if not len(held):
            return np.zeros(0, bool)
        settled = now_s - held.since_s > self._stays_s
        newest = np.argsort(-held.since_s, kind="stable")
        settled[newest[MOST:]] = True
        return settled

    def _index(self) -> tuple[tuple[float, float, float], NDArray[np.int32]]:
        """Return a box around all columns: its west and south, the cells' width, and each column's record."""
        cells, margin = self._held.cells, self._around
        first = cells.min(axis=0) - margin
        index = np.full(cells.max(axis=0) + 1 + margin - first, -1, np.int32)
        index[tuple((cells - first).T)] = np.arange(len(cells), dtype=np.int32)
        south_m, west_m = ((self._south_m, self._west_m) + first * self._cell_m).tolist()
        return (west_m, south_m, self._cell_m), index

    def _is_over(self, index: NDArray[np.int32]) -> Flags:
        """Return which columns are empty, as all around them."""
        stand = np.zeros(index.shape, bool)
        stand[index >= 0] = ~self._held.gone[index[index >= 0]]
        near = ndimage.maximum_filter(stand, size=2 * self._around + 1, mode="constant")
        over = np.zeros(len(self._held), bool)
        over[index[index >= 0]] = ~near[index >= 0]
        return over

    def _proven_empty(self, index: NDArray[np.int32]) -> Flags:
        """Return which columns the rays that passed prove empty."""
        records = self._held.records
        cells = np.argwhere(index >= 0)[np.argsort(index[index >= 0])]
        returned, before, since = sums_around(index, cells, self._around, records).T
        scans = records[:, SCANS_RETURNED : SCANS_SINCE + 1].T
        own = records[:, SINCE] >= OWN
        # The first one began the count.
        return own & _proves_empty(returned - 1, before, since) & _proves_empty(scans[0] - 1, *scans[1:])


def _proves_empty(returned: Points, before: Points, since: Points) -> Flags:
    """Return where numbers (m,) of what was returned, passed before and passed since prove emptiness."""
    share = CAUTION * betaincinv(np.maximum(returned, 0.5), before + 1, DOUBT)
    proven: Flags = since * -np.log1p(-share) >= -math.log(FALSE_ALARM)
    return proven


def _in_one_only(a: Points, b: Points) -> Points:
    """Return the points that are in one of two sets (n, 3) only."""
    points, count = np.unique(
        np.concatenate([np.unique(a, axis=0), np.unique(b, axis=0)]), axis=0, return_counts=True
    )
    altered: Points = points[count == 1]
    return altered
