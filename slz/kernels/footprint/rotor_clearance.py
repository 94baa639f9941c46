"""Headings at which rotor and tail stay clear of the cells around a landing point.

Both are solids fixed to the vehicle: a disc about the mast, and a strip behind the gear. A cell is in the way
where any part of it may be under the solid, for any touchdown within a cell of the box, and its ground
reaches up to the solid's underside. The floors below them are those of `rest_planes`.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Float32
from slz.kernels.footprint.rest_planes import Floors, Steepest
from slz.kernels.jit import kernel, kernel_part

NOBODY = -1  # cell in the way of a heading
# Height of the underside over the floor, margin taken off (m); height over the gear by which the solid moves
# sideways when it tilts (m); edges of its rectangle from the centre of gravity: rear, front, half width (m).
Solid = tuple[Float32, Float32, Float32, Float32, Float32]
UNDERSIDE, ARM, REAR, FRONT, ASIDE = range(5)
# Radius of the disc, margin included (m).
Disc = tuple[Solid, Float32]
# Where the strip begins and ends behind the centre of gravity, and its half width, margin included (m); sine
# and cosine of the angle by which the vehicle may miss the heading.
Strip = tuple[Solid, Float32, Float32, Float32, Float32, Float32]
# Row and column of each cell from the first cell of the box, and its highest ground (m): nearest first.
Cells = Array2D[np.int64]
Tops = Array1D[np.float32]


@kernel_part
def _floor_at(
    floors: Floors, place: int, heading: int, first: int, solid: Solid, f: float, q: float
) -> float:
    """Return the floor at a place of the vehicle's frame: forward and right of the centre of gravity (m).

    The corners are rear left, rear right, front left, front right, from index `first` on.
    """
    along = (f - solid[REAR]) / (solid[FRONT] - solid[REAR])
    across = (q + solid[ASIDE]) / (2 * solid[ASIDE])
    along, across = min(1.0, max(0.0, along)), min(1.0, max(0.0, across))
    left = floors[place, heading, first] * (1 - along) + floors[place, heading, first + 2] * along
    right = floors[place, heading, first + 1] * (1 - along) + floors[place, heading, first + 3] * along
    return float(left * (1 - across) + right * across)


@kernel_part
def _is_below_disc(disc: Disc, shift: float, north: float, east: float, cell: float) -> bool:
    """Return whether a cell may be under the disc; its centre is north and east of the touchdown's (m)."""
    y, x, radius = max(0.0, abs(north) - cell), max(0.0, abs(east) - cell), disc[1] + shift
    return y * y + x * x < radius * radius


@kernel_part
def _is_below_strip(strip: Strip, shift: float, f: float, q: float, extent: float) -> bool:
    """Return whether a cell may be under the strip: its centre forward and right of that of the touchdown's.

    extent: of half of both cells, along any axis of the vehicle.
    """
    _, begin, end, half, sine, cosine = strip
    half += shift
    if f > -begin * cosine + half * sine + extent or f < -(end + shift) - half * sine - extent:
        return False
    return abs(q) < half / cosine + max(0.0, extent - f) * sine / cosine + extent


@kernel
def keep_disc_headings(
    cells: Cells,
    tops: Tops,
    cols: int,
    cell_m: float,
    disc: Disc,
    floors: Floors,
    steepest: Steepest,
    turns: Array2D[np.float64],
    fits: Array1D[np.bool_],
    blocking: Array1D[np.int64],
) -> None:
    """Clear the headings at which the disc may touch a cell, and note the first such cell.

    Parameters
    ----------
    cells, tops
        (n, 2) and (n,), +inf where unknown.
    cols
        Columns of the box of touchdowns.
    turns
        (headings, 2) sine and cosine.
    blocking
        (headings,) index of the cell in the way; unchanged for other headings.
    """
    solid = disc[0]
    for heading in range(len(fits)):
        for i in range(len(tops)):
            if not fits[heading]:
                break
            for place in range(floors.shape[0]):
                north = (cells[i, 0] - place // cols) * cell_m
                east = (cells[i, 1] - place % cols) * cell_m
                gradient = steepest[place, heading]
                shift = solid[ARM] * gradient / math.sqrt(1 + gradient * gradient)
                if not _is_below_disc(disc, shift, north, east, cell_m):
                    continue
                sine, cosine = turns[heading, 0], turns[heading, 1]
                f, q = east * sine + north * cosine, east * cosine - north * sine
                floor = _floor_at(floors, place, heading, 0, solid, f, q) - gradient * cell_m
                if not tops[i] < floor + solid[UNDERSIDE]:
                    fits[heading], blocking[heading] = False, i
                    break


@kernel
def keep_strip_headings(
    cells: Cells,
    tops: Tops,
    cols: int,
    cell_m: float,
    strip: Strip,
    floors: Floors,
    steepest: Steepest,
    turns: Array2D[np.float64],
    fits: Array1D[np.bool_],
    blocking: Array1D[np.int64],
) -> None:
    """Clear the headings at which the strip may touch a cell, see `keep_disc_headings`."""
    solid = strip[0]
    row, col = (floors.shape[0] // cols - 1) / 2, (cols - 1) / 2  # middle of the box
    around_m = (row + col) * cell_m
    for heading in range(len(fits)):
        sine, cosine = turns[heading, 0], turns[heading, 1]
        extent = cell_m * (abs(sine) + abs(cosine))
        for i in range(len(tops)):
            if not fits[heading]:
                break
            north, east = (cells[i, 0] - row) * cell_m, (cells[i, 1] - col) * cell_m
            f, q = east * sine + north * cosine, east * cosine - north * sine
            if not _is_below_strip(strip, solid[ARM], f, q, extent + around_m):
                continue
            for place in range(floors.shape[0]):
                north = (cells[i, 0] - place // cols) * cell_m
                east = (cells[i, 1] - place % cols) * cell_m
                f, q = east * sine + north * cosine, east * cosine - north * sine
                gradient = steepest[place, heading]
                shift = solid[ARM] * gradient / math.sqrt(1 + gradient * gradient)
                if not _is_below_strip(strip, shift, f, q, extent):
                    continue
                floor = _floor_at(floors, place, heading, 4, solid, f, q) - gradient * cell_m
                if not tops[i] < floor + solid[UNDERSIDE]:
                    fits[heading], blocking[heading] = False, i
                    break
