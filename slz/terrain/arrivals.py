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
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from params import Parameters
from slz.kernels.air.passing_rays import (
    BASE,
    BASE_EAST,
    CAME,
    COL,
    COLUMN_FIELDS,
    GONE,
    ROW,
    TOP,
    TOP_EAST,
    count_passing,
    index_of,
    passed,
)
from slz.kernels.air.standing_columns import join, stand_around

SAME_M = 0.7  # over what stands in a column, up to which an isolated return may be its
AROUND_M = 0.4  # around a column, in which other returns are of the same object
FEET_M = 0.1  # over known ground, from which returns around a column are of what stands there
FALSE_ALARM, DOUBT = 1e-3, 0.05
FOOT_M = 0.05  # more than the relief limit that the ground was lower when it came
CAUTION = 0.7  # of the share's lower bound, for what is seen a little differently from one window to the next
LEAST_SCANS = math.log(FALSE_ALARM) / math.log1p(-CAUTION)  # fewer prove nothing, if all rays were returned
STAYS = 0.5  # of `max_age_s`, for which what stands is kept apart
MOST, MOST_AFAR = 8192, 65536  # columns around the sensor, and elsewhere
MOST_SIDE = 500  # columns along the side of the box around the sensor
MOST_RAYS = 30_000  # of a window that are followed

Points = NDArray[np.float64]
Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]
CELL, HIGHEST, LOWEST = slice(ROW, COL + 1), slice(TOP_EAST, TOP + 1), slice(BASE_EAST, BASE + 1)


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
        self._corner = west_m, south_m, parameters.cell_m
        self._stays_s = STAYS * parameters.max_age_s
        self._below_m = np.array([0.0, 0.0, parameters.relief_m + FOOT_M])
        self._around = math.ceil(AROUND_M / parameters.cell_m)
        # The map's grid holds all that is within a quarter of its side of the sensor.
        self._reach = min(MOST_SIDE // 2, max(1, int(parameters.zone_m / 4 / parameters.cell_m) - 1))
        self._held: Points = np.empty((0, COLUMN_FIELDS))
        self.points_enu_m: Points = np.empty((0, 3))
        self.altered_enu_m: Points = np.empty((0, 3))

    def __len__(self) -> int:
        """Number of columns in which something stands."""
        return len(self.points_enu_m) // 2

    def update(
        self,
        points_enu_m: Points,
        rows: Rows,
        raised: Flags,
        isolated: Flags,
        is_over: Callable[[Rows], Flags],
        origin: NDArray[np.uint16],
        origins_enu_m: Points,
        sensor_enu_m: Points,
        now_s: float,
    ) -> tuple[Rows, Points]:
        """Take a window; return the rows that are no evidence, and points that are so from now on.

        No evidence is what stands in the columns, down to its feet in those beside them; evidence from now on
        are the highest and lowest returns of what has stood for long.

        Parameters
        ----------
        points_enu_m, rows
            (n, 3) returns, and the rows of those to take, in the order of their scans.
        raised
            (n,) which of them are higher over known ground than noise and a height explain, with lower ground
            on all sides; in the heights of the evidence.
        isolated
            (n,) which of them have few others around them. Alone they are no arrival.
        is_over
            Returns which of some rows are more than `FEET_M` and noise over known ground: around a column
            they are its own, whatever is beside them.
        origin, origins_enu_m
            (n,) the scan of each return, and (k, 3) the sensor's position in each scan, likewise; NaN where
            its rays prove nothing, such as a radar's.
        sensor_enu_m
            (3,) east, north and up of the last scan.
        """
        west_m, south_m, cell_m = self._corner
        here = np.floor((sensor_enu_m[1::-1] - (south_m, west_m)) / cell_m)
        within = np.abs(self._held[:, CELL] - here).max(axis=1, initial=0.0) <= self._reach
        near, afar, raised = self._held[within], self._held[~within], raised.copy()
        near, own, beside = join(
            near, points_enu_m, rows, raised, isolated, origin, origins_enu_m,
            here, self._reach, self._around, SAME_M, *self._corner, now_s,
        )  # fmt: skip
        settled = self._settled(near, now_s)
        evidence, near = _ends(near[settled]), near[~settled]
        if len(near):
            row, col, index, blocks = index_of(near, self._around)
            corner = west_m + col * cell_m, south_m + row * cell_m, cell_m
            stride = max(1, math.ceil(len(rows) / MOST_RAYS))
            count_passing(
                points_enu_m, rows, origin, origins_enu_m, raised, stride,
                *corner, self._around, index, blocks, near,
            )  # fmt: skip
            which, counts = passed(index, self._around, LEAST_SCANS, near)
            if len(which):
                near[which[_prove_empty(counts)], GONE] = 1.0
            near = near[stand_around(near, self._around)]
        if len(afar) > MOST_AFAR:
            afar = afar[np.argsort(np.argsort(-afar[:, CAME], kind="stable")) < MOST_AFAR]
        self._held = np.concatenate([near, afar])
        before, standing = self.points_enu_m, _ends(self._held)
        standing[len(standing) // 2 :] -= self._below_m
        self.points_enu_m, self.altered_enu_m = standing, _in_one_only(before, standing)
        return np.concatenate([own, beside[is_over(beside)]]), evidence

    def _settled(self, near: Points, now_s: float) -> Flags:
        """Return which columns are evidence from now on: the oldest, and those beyond what is kept.

        None that is far from the sensor: the map's grid may not hold it now.
        """
        settled: Flags = now_s - near[:, CAME] > self._stays_s
        if len(near) > MOST:
            settled[np.argsort(-near[:, CAME], kind="stable")[MOST:]] = True
        return settled


def _ends(records: Points) -> Points:
    """Return the highest, then the lowest returns (n, 3) of columns that are not gone."""
    standing = records[records[:, GONE] == 0.0]
    return np.concatenate([standing[:, HIGHEST], standing[:, LOWEST]])


def _prove_empty(counts: Points) -> Flags:
    """Return which counts (m, 6) prove emptiness, of rays and of scans; the first one began the count."""
    returned, before, since, scans, scans_before, scans_since = counts.T
    return _exceed(returned - 1, before, since) & _exceed(scans - 1, scans_before, scans_since)


def _exceed(returned: Points, before: Points, since: Points) -> Flags:
    """Return where so many passed since that none would have been returned with little probability."""
    share = CAUTION * betaincinv(np.maximum(returned, 0.5), before + 1, DOUBT)
    exceed: Flags = since * -np.log1p(-share) >= -math.log(FALSE_ALARM)
    return exceed


def _in_one_only(a: Points, b: Points) -> Points:
    """Return the points that are in one of two sets (n, 3) only."""
    rows_of_a, rows_of_b = ({*points.view("V24").ravel().tolist()} for points in (a, b))
    return np.frombuffer(bytearray().join(sorted(rows_of_a ^ rows_of_b))).reshape(-1, 3)
