"""Rotor disc and tail of the landed vehicle: the headings at which both stay clear of ground and objects."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.cells.cell_record import EXCESS, HEIGHT, TOP, WEIGHT
from slz.kernels.footprint.rest_planes import CORNERS, Floors, Steepest
from slz.kernels.footprint.rest_pose import Ground, plane_of
from slz.kernels.footprint.rotor_clearance import (
    NOBODY,
    UNDERSIDE,
    Disc,
    Strip,
    keep_disc_headings,
    keep_strip_headings,
)
from slz.kernels.raster.bitmap import unpacked
from slz.kernels.raster.morphology import above
from slz.terrain.derive import reach_of, seen_ground
from slz.terrain.gear import HEADING_ERROR_DEG, HEADING_STEP_DEG

HEADINGS = 360 // HEADING_STEP_DEG
SLACK_M = 1e-3  # for rounding, where cells are left out that no plane brings near

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Discs:
    """Rotor disc and tail of a vehicle, margins included, for cells of a size.

    disc, strip: see `slz.kernels.footprint.rotor_clearance`; None for none. corners_m: (headings, 16) east
    and north of the corners of their rectangles. turns: (headings, 2) sine and cosine. reach: cells from the
    touchdown's cells to the farthest that matters. margin: cells beyond, on which it depends what was seen.
    steepest: greatest gradient at which the vehicle may rest.
    """

    disc: Disc | None
    strip: Strip | None
    corners_m: Floats
    turns: Floats
    reach: int
    margin: int
    steepest: float


@dataclass(frozen=True, slots=True)
class InTheWay:
    """Nearest cell that is in the way at some heading.

    part: "rotor" or "tail". height_m: over the ground's plane, NaN for unseen ground. distance_m: horizontal,
    between the middles of that cell and of the touchdown's cells.
    """

    part: str
    height_m: float
    distance_m: float

    @property
    def text(self) -> str:
        """Part of the vehicle, and what is in its way, in words."""
        what = "unseen ground" if math.isnan(self.height_m) else f"{self.height_m:.1f} m high"
        return f"{self.part}: {what} at {self.distance_m:.1f} m"


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """Box of rows x cols cells on which the vehicle may touch down, and the cells around it.

    cells: (6, rows + 2 edge, cols + 2 edge) of `slz.kernels.cells.cell_statistics.summarise`; the edge is at
    least `Discs.reach + Discs.margin`. ground: the same cells, from the box's first one on. radius: of a
    footprint, in cells.
    """

    cells: NDArray[np.float32]
    ground: Ground
    rows: int
    cols: int
    edge: int
    radius: int
    cell_m: float

    @property
    def middle(self) -> tuple[int, int]:
        """Row and column of the cell in the middle of the box, among all cells."""
        return self.edge + self.rows // 2, self.edge + self.cols // 2

    def plane(self) -> tuple[float, float, float]:
        """Return level, rise per column and rise per row of the footprint's plane about that cell (m)."""
        lower, mean, upper, wide, _, _ = self.ground
        return plane_of((lower, mean, upper, wide, *self.middle), self.radius)

    def outside(self) -> Floats:
        """Return how far every cell is from the box, in cells."""
        row, col = np.ogrid[: self.cells.shape[1], : self.cells.shape[2]]
        middle_row, middle_col = self.edge + (self.rows - 1) / 2, self.edge + (self.cols - 1) / 2
        return np.hypot(
            np.maximum(0, np.abs(row - middle_row) - (self.rows - 1) / 2),
            np.maximum(0, np.abs(col - middle_col) - (self.cols - 1) / 2),
        )

    def from_middle_m(self, cell: NDArray[np.intp]) -> float:
        """Return the distance of a cell from the middle of the box."""
        middle = self.edge + np.array([self.rows - 1, self.cols - 1]) / 2
        return float(np.hypot(*(cell - middle))) * self.cell_m


@functools.lru_cache(maxsize=8)
def discs_of(parameters: Parameters, cell_m: float) -> Discs | None:
    """Return disc and tail for cells of a size; None for a vehicle with neither."""
    p = parameters
    if p.mode == "source" or not (p.rotor_diameter_m or p.tail_length_m):
        return None
    tilt, margin_m = math.radians(p.greatest_tilt_deg), p.rotor_clearance_m
    turned = np.radians(np.arange(HEADINGS) * HEADING_STEP_DEG)
    turns = np.stack([np.sin(turned), np.cos(turned)], axis=1)
    disc: Disc | None = None
    strip: Strip | None = None
    rotor_m = tail_m = aside_m = 0.0
    if p.rotor_diameter_m:
        radius_m = p.rotor_diameter_m / 2 + margin_m
        rotor_m = radius_m + p.rotor_height_m * math.sin(tilt) + 2 * cell_m
        disc = (p.rotor_height_m - margin_m, p.rotor_height_m, -rotor_m, rotor_m, rotor_m), radius_m
    if p.tail_length_m:
        arm_m, error = max(p.tail_height_m, p.rotor_height_m), math.radians(HEADING_ERROR_DEG)
        half_m, shift_m = p.tail_width_m / 2 + margin_m, arm_m * math.sin(tilt)
        tail_m = p.tail_length_m + margin_m + shift_m + (half_m + shift_m) * math.sin(error) + 2 * cell_m
        aside_m = (half_m + shift_m) / math.cos(error) + tail_m * math.tan(error) + 4 * cell_m
        solid = p.tail_height_m - margin_m, arm_m, -tail_m, 2 * cell_m, aside_m
        begin_m, end_m = p.gear_size_m[0] / 2, p.tail_length_m + margin_m
        strip = solid, begin_m, end_m, half_m, math.sin(error), math.cos(error)
    rectangles = [
        (f, q)
        for rear, front, aside in ((-rotor_m, rotor_m, rotor_m), (-tail_m, 2 * cell_m, aside_m))
        for f in (rear, front)
        for q in (-aside, aside)
    ]
    forward, right = np.array(rectangles).T
    sine, cosine = turns.T[:, :, None]
    corners = np.stack([forward * sine + right * cosine, forward * cosine - right * sine], axis=2)
    reach = math.ceil(max(rotor_m, math.hypot(tail_m, aside_m)) / cell_m)
    margin = 4 * reach_of(p, cell_m).gap + 3
    steepest = math.tan(tilt)
    return Discs(disc, strip, corners.reshape(HEADINGS, 2 * CORNERS), turns, reach, margin, steepest)


def keep_clear_headings(
    discs: Discs, site: Site, parameters: Parameters, floors: Floors, steepest: Steepest, fits: Flags
) -> InTheWay | None:
    """Clear the headings at which disc or tail may touch something, for a touchdown on any cell of the box.

    Ground that does not count as seen is in the way; see `slz.terrain.derive.seen_ground`.

    Parameters
    ----------
    floors, steepest
        Of `slz.kernels.footprint.rest_planes.keep_rests`.
    fits
        (headings,) whether the gear stands at each.

    Returns
    -------
    The nearest cell in the way at any heading; None where all headings of the gear stay.
    """
    fits &= np.isfinite(floors).all(axis=(0, 2)) & (steepest <= discs.steepest + SLACK_M).all(axis=0)
    if not fits.any():
        return None
    tops, over = _tops(site, parameters)
    outside = site.outside()
    drop_m = _floors_over_plane(discs, site, floors, fits) - float(steepest[:, fits].max()) * site.cell_m
    found: list[InTheWay] = []
    for part, solid, first in (("rotor", discs.disc, 0), ("tail", discs.strip, CORNERS // 2)):
        if solid is None:
            continue
        lowest_m = float(drop_m[first : first + CORNERS // 2].min()) + solid[0][UNDERSIDE] - SLACK_M
        near = np.argwhere(~(over < lowest_m) & (outside <= discs.reach))
        near = near[np.argsort(outside[*near.T], kind="stable")]
        blocking = np.full(HEADINGS, NOBODY)
        where, high = near - site.edge, tops[*near.T]
        pose = floors, steepest, discs.turns, fits, blocking
        if discs.disc is not None and part == "rotor":
            keep_disc_headings(where, high, site.cols, site.cell_m, discs.disc, *pose)
        elif discs.strip is not None:
            keep_strip_headings(where, high, site.cols, site.cell_m, discs.strip, *pose)
        if (blocking != NOBODY).any():
            cell = near[blocking[blocking != NOBODY].min()]
            height_m = float(over[*cell])
            height_m = height_m if math.isfinite(height_m) else math.nan
            found.append(InTheWay(part, height_m, site.from_middle_m(cell)))
    return min(found, key=lambda one: one.distance_m, default=None)


def _tops(site: Site, parameters: Parameters) -> tuple[NDArray[np.float32], Floats]:
    """Return the highest ground of all cells, and its height over the footprint's plane.

    Both are +inf where ground was not seen, and -inf in narrow gaps, which count as seen.
    """
    cells, (_, _, upper, wide, _, _), reach = site.cells, site.ground, reach_of(parameters, site.cell_m)
    known = above(np.ascontiguousarray(cells[WEIGHT]), np.float32(0))
    seen = seen_ground(known, np.ascontiguousarray(cells[HEIGHT]), reach, site.cell_m, parameters)
    tops = np.where(unpacked(seen, 0, wide) != 0, upper.reshape(-1, wide), np.float32(np.inf))
    (level, east, north), (middle_row, middle_col) = site.plane(), site.middle
    row, col = np.ogrid[: tops.shape[0], : tops.shape[1]]
    return tops, tops - (level + east * (col - middle_col) + north * (row - middle_row))


def _floors_over_plane(discs: Discs, site: Site, floors: Floors, fits: Flags) -> Floats:
    """Return the lowest floor at each corner over the footprint's plane, of all touchdowns and headings."""
    level, east_rise, north_rise = site.plane()
    east, north = discs.corners_m[fits].reshape(-1, CORNERS, 2).transpose(2, 0, 1)
    row, col = np.divmod(np.arange(site.rows * site.cols), site.cols)
    there = level + east_rise * (col - site.cols // 2) + north_rise * (row - site.rows // 2)
    rise = (east_rise * east + north_rise * north) / site.cell_m
    lowest: Floats = (floors[:, fits] - rise - there[:, None, None]).min(axis=(0, 1))
    return lowest


def upper_ground(cells: NDArray[np.float32], level: float) -> NDArray[np.float32]:
    """Return the highest ground of cells over a level, less what noise adds; -inf where unknown."""
    known = cells[WEIGHT] > 0
    return np.where(known, cells[TOP] - level - cells[EXCESS], -np.inf).astype(np.float32)
