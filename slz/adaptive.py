"""Adaptive window length and resolution, from density, height, speed (SLZ paper and thesis, future work)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.frame import is_known
from slz.kernels.cells.accumulate import hit_squares
from slz.kernels.points.range_gate import extent, heights_and_ranges
from slz.window import Window

COARSEST = 2  # pyramid level of the far map with cells of `far_cell_m`
RETURNS_PER_CELL = 1.0  # least returns in a cell within `window_s`
RETURNS_WANTED = 8.0  # returns of one window in a near cell, for which the window length is chosen
FEWEST_FOR_HEIGHT = 30  # returns that are enough for the height of the ground
STEADY = 2.5  # spans of `window_s`, whose windows must ask for another level
TIMING_S = 0.005  # error of the time match of poses and returns
HYSTERESIS = 0.9
LOW_M = 8.0  # height over the ground, below which no window is extended, so that intruders are seen at once
SAMPLE_RETURNS = 20_000  # returns that are enough to characterise a window
MOST_SQUARES = 100_000_000
SQUARES_M = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # sides of the squares that count the ground hit
RETURNS_PER_SQUARE = 4  # mean, below which wider squares are used
WIDER = 0.05  # margin of the extent of a sample, relative, that the extent of all returns seldom exceeds
Extent = tuple[float, float, float, float]  # west, east, south, north (m)


class PlacedReturns(Protocol):
    """Returns of a window that were placed in cells."""

    n: int

    def kept(self, every: int = 1) -> NDArray[np.float64]:
        """Return the points (m, 3) that no outlier rule dropped, every `every`-th of them."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Features of a window, and the choice made from them.

    density_per_m2: returns per square metre of ground hit, within `window_s` where that adapts. height_m: of
    the sensor over the median return, NaN where unknown. speed_ms: of the sensor over ground, the last one
    known; 0 before any. far: the far map is the active one. level: pyramid level of the far map's cells.
    window_s: longest span that suits the next windows.
    """

    density_per_m2: float
    height_m: float
    speed_ms: float
    far: bool
    level: int
    window_s: float


class Adapter:
    """Selection of mode, resolution and window length from the windows themselves.

    - Far mode is chosen above `far_height_m` or faster than `far_speed_ms` (SLZ thesis, section 4.4.4), near
      mode again below nine tenths of both. A window without height and speed changes nothing.
    - The far map gets the finest cells that receive one return each within `window_s` and are not finer than
      the position error of returns: two standard deviations of ray direction times height, and of timing
      times speed. All windows of `STEADY` times that span must agree. The near map keeps its cells: coarser
      ones hide hazards.
    - The longest window of use gives the near map's cells eight returns each, and in it the vehicle flies at
      most half of its view to one side. Its span is from half to twice `window_s`, below `LOW_M` at most
      `window_s`.

    With `adaptive=off` and in source mode only near and far change, and far cells are those of `far_cell_m`.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self._adaptive = parameters.adaptive == "on" and parameters.mode == "default"
        self._before: tuple[int, NDArray[np.float64]] | None = None
        self._ended_ns: int | None = None
        self._speed_ms = 0.0
        self._far = False
        self._level = COARSEST
        self._asked: list[tuple[int, int]] = []  # ends of the latest windows, and the levels they ask for

    def choose(self, window: Window, points_enu_m: NDArray[np.float64]) -> Choice:
        """Return the choice after a window, from its returns in use."""
        points, every = np.ascontiguousarray(points_enu_m), max(1, len(points_enu_m) // SAMPLE_RETURNS)
        sensor = np.asarray(window.sensor_enu_m, np.float64)
        heights_m, ranges_m = heights_and_ranges(points, sensor, every)
        ground_m = _median(heights_m) if len(heights_m) >= FEWEST_FOR_HEIGHT else math.nan
        height = float(window.sensor_enu_m[2]) - ground_m
        speed = self._speed(window)
        reach = _median(ranges_m) if len(points) else 0.0
        density = _density(points, np.ascontiguousarray(points[::every]))
        self._far = self._is_far(height, speed)
        level, window_s, lasts_s = self._level, self._p.window_s, self._lasts_s(window)
        if self._adaptive and density > 0 and math.isfinite(height):
            density *= window_s / lasts_s
            level = self._steady(self._wanted_level(density, height, speed), window.end_ns)
            window_s = self._wanted_window(density / window_s, reach, height, speed)
        return Choice(density, height, speed, self._far, level, window_s)

    def choose_from_cells(self, window: Window, returns: PlacedReturns) -> Choice:
        """Return the choice in source mode, where only near and far change, from a sample of the returns.

        Where the position of the sensor is unknown nothing changes and the density is 0.
        """
        if not is_known(window.sensor_enu_m):
            return Choice(0.0, math.nan, self._speed(window), self._far, self._level, self._p.window_s)
        every = max(1, returns.n // SAMPLE_RETURNS)
        choice = self.choose(window, returns.kept(every))
        return replace(choice, density_per_m2=every * choice.density_per_m2)

    def _lasts_s(self, window: Window) -> float:
        """Return the time that a window stands for: since the last one ended, or from its first return."""
        before_ns, self._ended_ns = self._ended_ns, window.end_ns
        spans_ns, since_ns = window.end_ns - window.start_ns, window.end_ns - (before_ns or window.end_ns)
        return max(spans_ns * 1e-9, min(since_ns * 1e-9, self._p.window_s)) or self._p.window_s

    def _speed(self, window: Window) -> float:
        """Return the speed since the last window with a known position."""
        before, now = self._before, (window.end_ns, window.sensor_enu_m)
        if not is_known(now[1][:2]):
            return self._speed_ms
        self._before = now
        if before is not None and now[0] > before[0]:
            way = float(np.hypot(*(now[1] - before[1])[:2]))
            self._speed_ms = way / ((now[0] - before[0]) * 1e-9)
        return self._speed_ms

    def _is_far(self, height_m: float, speed_ms: float) -> bool:
        if self._far and math.isnan(height_m):
            return True
        share = HYSTERESIS if self._far else 1.0
        return height_m > share * self._p.far_height_m or speed_ms > share * self._p.far_speed_ms

    def _wanted_level(self, density: float, height_m: float, speed_ms: float) -> int:
        p = self._p
        placed_m = math.hypot(math.radians(p.angle_noise_deg) * height_m, TIMING_S * speed_ms)
        finest = max(math.sqrt(RETURNS_PER_CELL / density), 2 * placed_m)
        level = COARSEST
        while level > 0 and p.far_cell_m / 2 ** (COARSEST - level + 1) >= finest:
            level -= 1
        return level

    def _steady(self, wanted: int, at_ns: int) -> int:
        """Return the level after a window that asks for one, at the time of its end."""
        span_ns = self._p.window_s * 1e9
        lately = [one for one in self._asked if 0 <= at_ns - one[0] < STEADY * span_ns]
        self._asked = [*lately, (at_ns, wanted)]
        if at_ns - self._asked[0][0] < (STEADY - 1) * span_ns:
            return self._level
        levels = [level for _, level in self._asked]
        if min(levels) > self._level:
            self._level = min(levels)
        elif max(levels) < self._level:
            self._level = max(levels)
        return self._level

    def _wanted_window(self, per_m2_s: float, reach_m: float, height_m: float, speed_ms: float) -> float:
        p = self._p
        step_s, longest_s = p.window_s / 4, (2 if height_m > LOW_M else 1) * p.window_s
        steps = round(min(RETURNS_WANTED / (per_m2_s * p.cell_m**2), longest_s) / step_s)
        if speed_ms > 0 and math.isfinite(reach_m):
            steps = min(steps, math.floor(min(reach_m / 2 / speed_ms, longest_s) / step_s))
        return max(2, steps) * step_s


def _median(values: NDArray[np.float64]) -> float:
    """Return the median of values (n,), n > 0; NumPy's own takes 60 calls of Python."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    parted = np.partition(values, (low, high))
    return float(parted[low] + parted[high]) / 2


def _density(points: NDArray[np.float64], some: NDArray[np.float64]) -> float:
    """Return the returns per square metre of ground hit, from all and from a sample of them.

    Squares that hold a return or two each prove nothing about the ground between them: then wider squares are
    counted.
    """
    if not len(points):
        return 0.0
    density, around = 0.0, _widened(*extent(some))  # very likely the extent of all
    for side in SQUARES_M:
        hit, outside = _squares_hit(points, side, around)
        if outside:
            around = extent(points)
            hit, _ = _squares_hit(points, side, around)
        if not hit:
            continue
        density = len(points) / (hit * side**2)
        if len(points) >= RETURNS_PER_SQUARE * hit:
            break
    return density


def _widened(west_m: float, east_m: float, south_m: float, north_m: float) -> Extent:
    east, north = WIDER * (east_m - west_m), WIDER * (north_m - south_m)
    return west_m - east, east_m + east, south_m - north, north_m + north


def _squares_hit(points: NDArray[np.float64], side: float, around: Extent) -> tuple[int, int]:
    """Return how many squares hold a point, and whether a point is outside; 0 and 0 for too many squares."""
    west_m, east_m, south_m, north_m = around
    west, south = math.floor(west_m / side) * side, math.floor(south_m / side) * side
    cols, rows = (1 + math.floor((m - low) / side) for m, low in ((east_m, west), (north_m, south)))
    if rows * cols > MOST_SQUARES:
        return 0, 0
    return hit_squares(points, west, south, side, rows, cols)
