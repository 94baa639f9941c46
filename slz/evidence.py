"""Terrain from per-cell evidence: the default, safer terrain model.

Where the sources are unsafe this differs: steep ground is written as evidence; a cell keeps count, mean,
expected noise and its two lowest and highest returns, so a pole inside a cell does not vanish in a mean;
slope and relief come from a plane fitted over the vehicle's footprint; whatever was seen is kept for at
least `hold_s` of newer observations; ground not seen for `max_age_s` and ground never seen are unknown, and
unknown is not safe.

A cell is *safe* when a vehicle whose footprint is centred on it stands on seen ground whose plane slopes
less than the limit, three standard errors included, and on which nothing rises or falls by the relief limit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz.grid import Box, Grid, overlap
from slz.kernels.footprint import HEIGHT, TOP, WEIGHT, closed, highest_around, planes, summarise
from slz.kernels.scatter import box_of, gather_evidence
from slz.maps import SAFE, UNKNOWN, UNSAFE

HEIGHTS = ("height_m", "top_m")
SIGMAS = 3.0  # standard errors that the slope keeps from its limit
LAYERS = ("height_m", "top_m", "slope_deg", "slope_sigma_deg", "relief_m", "roughness")
_UNTOUCHED, _SAFE, _UNSAFE, _UNKNOWN = (np.uint8(i) for i in range(4))  # zero, so that pages stay unmapped
_STATE = np.array([UNKNOWN, SAFE, UNSAFE, UNKNOWN], np.uint8)


class EvidenceTerrain:
    """Evidence and the maps drawn from it over one zone; pages of untouched ground take no memory."""

    def __init__(self, grid: Grid, parameters: Parameters) -> None:
        self.grid = grid
        self._parameters = parameters
        shape = grid.rows, grid.cols
        # One cache line a cell: current and previous epoch of 8 float32 (slz.kernels.scatter).
        self.evidence = np.zeros((*shape, 2, 8), np.float32)
        self._layers = {name: np.zeros(shape, np.float32) for name in LAYERS}
        self._verdict = np.zeros(shape, np.uint8)
        self.safe = np.zeros(shape, np.uint8)
        self.seen = Box(0, 0, 0, 0)
        self.datum_m = 0.0
        """Height of the map's zero: heights are kept without it and given out with it."""
        self._epoch_s: float | None = None
        self._aged_s = 0.0
        half = parameters.footprint_m / 2 / grid.cell_m
        self.radius = max(1, math.ceil(half - 0.5 - 1e-9))
        self._gap = max(0, round((parameters.coverage_m / grid.cell_m - 1) / 2))
        self._margin = self.radius + 4 * self._gap + 2  # how far one cell's evidence can matter

    def add(
        self,
        points_enu_m: NDArray[np.float64],
        sensor_enu_m: NDArray[np.float64],
        low_m: float,
        high_m: float,
        stamp_s: float,
    ) -> Box:
        """Add one window of points whose height lies in the interval; return the box that changed."""
        grid, p = self.grid, self._parameters
        if self._epoch_s is None:
            self._epoch_s = stamp_s
        now_s = stamp_s - self._epoch_s
        r0, r1, c0, c1, inside = box_of(
            points_enu_m, grid.west_m, grid.south_m, grid.cell_m, grid.rows, grid.cols, low_m, high_m
        )
        touched = Box(int(r0), int(r1), int(c0), int(c1)) if inside else Box(0, 0, 0, 0)
        if inside:
            gather_evidence(
                points_enu_m,
                sensor_enu_m,
                p.range_noise_m,
                math.radians(p.angle_noise_deg),
                grid.west_m,
                grid.south_m,
                grid.cell_m,
                low_m,
                high_m,
                now_s,
                p.hold_s,
                self.evidence,
            )
            self.seen = self.seen.union(touched)
        changed = touched.grown(self._margin, grid) if inside else touched
        if now_s - self._aged_s > p.max_age_s / 10:
            self._aged_s, changed = now_s, self.seen.grown(self._margin, grid)
        if not changed.empty:
            self._redraw(changed, now_s)
        return changed

    def _redraw(self, box: Box, now_s: float) -> None:
        """Draw the maps of a box anew from the evidence of the box and its surroundings."""
        p, grid = self._parameters, self.grid
        wide = box.grown(self._margin, grid)
        cells = summarise(self.evidence[wide.slices], now_s, p.max_age_s)
        known = cells[WEIGHT] > 0
        covered = closed(known.astype(np.uint8), self._gap)
        fits = planes(cells, covered, self.radius, grid.cell_m, p.range_noise_m, p.safe_slope_deg, p.relief_m)
        unseen = self._unseen(known, cells[HEIGHT])
        inner = (
            slice(box.row0 - wide.row0, box.row1 - wide.row0),
            slice(box.col0 - wide.col0, box.col1 - wide.col0),
        )
        slope, sigma, relief, rms = (fits[i][inner] for i in range(4))
        gentle = slope + SIGMAS * sigma < np.float32(p.safe_slope_deg)
        even = gentle & (relief < np.float32(p.relief_m))
        safe = even & ~unseen[inner]
        unknown = np.isnan(slope) | (even & ~safe)
        for fit in (slope, sigma, relief, rms):
            fit[unknown] = np.nan
        values = (cells[HEIGHT][inner], cells[TOP][inner], slope, sigma, relief, rms)
        for name, value in zip(LAYERS, values, strict=True):
            self._layers[name][box.slices] = value
        self._verdict[box.slices] = np.where(safe, _SAFE, np.where(unknown, _UNKNOWN, _UNSAFE))
        self.safe[box.slices] = safe
        self._close_edges()

    def _unseen(self, known: NDArray[np.bool_], height_m: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Tell which footprints hold unseen ground.

        What stands in the middle of unseen ground must not make that ground seen: cells above ground near
        enough for a gap between to count as seen close no gap. And the outermost seen cells may be part
        water, part shore.
        """
        lowest = -highest_around(-height_m, 2 * self._gap)
        raised = height_m - lowest > np.float32(self._parameters.relief_m)
        seen = known | (closed((known & ~raised).astype(np.uint8), self._gap) == 1)
        whole = ndimage.binary_erosion(seen, np.ones((3, 3), bool), border_value=1)
        return np.asarray(highest_around((~whole).astype(np.float32), self.radius) > 0)

    def _close_edges(self) -> None:
        """Keep the unsafe margin around the map that tracing needs (SLZ paper §3.3.1)."""
        for edge in (self.safe[0], self.safe[-1], self.safe[:, 0], self.safe[:, -1]):
            edge[:] = 0

    def moved(self, grid: Grid) -> EvidenceTerrain:
        """Return the terrain of a new zone with the evidence of the common part (SLZ paper §3.2.5)."""
        new = EvidenceTerrain(grid, self._parameters)
        mine, theirs = overlap(self.grid, grid)
        new._epoch_s, new._aged_s, new.datum_m = self._epoch_s, self._aged_s, self.datum_m
        if not mine.empty:
            new.evidence[theirs.slices] = self.evidence[mine.slices]
            new._verdict[theirs.slices] = self._verdict[mine.slices]
            new.safe[theirs.slices] = self.safe[mine.slices]
            for name, layer in self._layers.items():
                new._layers[name][theirs.slices] = layer[mine.slices]
            new._close_edges()
            new.seen = theirs
        return new

    def state(self, box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box; a footprint with unseen ground is unknown."""
        return np.asarray(_STATE[self._verdict[box.slices]])

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        """Return a copy of one of `LAYERS` over a box, NaN where unknown.

        The relief is NaN also where the slope alone makes the cell unsafe.
        """
        drawn = self._verdict[box.slices] != _UNTOUCHED
        datum = np.float32(self.datum_m if name in HEIGHTS else 0.0)
        return np.where(drawn, self._layers[name][box.slices] + datum, np.float32(np.nan))
