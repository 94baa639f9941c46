"""Lower envelope of the planes on which the gear can rest, at the corners of rectangles around the vehicle.

What is fixed to the vehicle, such as rotor and tail, tilts with the gear. Where the gear can rock, or a pad
may be at either side of an edge, it rests on one of several planes. Their minimum is a concave function of
the place, so that within a rectangle it is nowhere below the bilinear interpolation of its values at the four
corners. For a single plane both are equal.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.footprint.rest_pose import (
    A_LINE,
    PARTS,
    Contacts,
    GearLimits,
    Ground,
    Row,
    contact_heights,
    plane_of,
    put_at_edges,
    rest_on,
    scratch_for,
    upper_hull,
)
from slz.kernels.jit import kernel

RECTANGLES = 2  # of rotor and tail
CORNERS = 4 * RECTANGLES
# East and north of the corners from the centre of gravity at each heading (m), flat.
Corners = Array2D[np.float64]
Floors = Array3D[np.float64]
Steepest = Array2D[np.float64]


@kernel
def _lower(corners: Corners, heading: int, a: float, b: float, c: float, floor: Array1D[np.float64]) -> None:
    """Lower the floor at the corners of a heading to a plane."""
    for i in range(CORNERS):
        floor[i] = min(floor[i], a * corners[heading, 2 * i] + b * corners[heading, 2 * i + 1] + c)


@kernel
def _lower_to_rests(
    contacts: Contacts,
    own: int,
    heights: Row,
    kept: Array1D[np.int64],
    n: int,
    corners: Corners,
    place: int,
    floors: Floors,
    steepest: Steepest,
) -> None:
    """Lower the floors to every plane on which a gear can rest, see `steepest_rest`.

    Parameters
    ----------
    own
        Heading of the contacts; the corners have those of all turns that leave the gear the same, too.
    kept, n
        The first n are the contacts that can touch.
    place
        Row of the floors and of the steepest gradients.
    """
    period = contacts.shape[0]
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                gradient, a, b, c = rest_on(contacts, own, heights, kept, n, kept[i], kept[j], kept[k])
                if gradient < np.inf:
                    for heading in range(own, corners.shape[0], period):
                        _lower(corners, heading, a, b, c, floors[place, heading])
                        steepest[place, heading] = max(steepest[place, heading], gradient)


@kernel
def rest_floors(
    ground: Ground,
    radius: int,
    rows: int,
    cols: int,
    cell_m: float,
    contacts: Contacts,
    limits: GearLimits,
    noise_m: float,
    fits: Array1D[np.bool_],
    corners: Corners,
    floors: Floors,
    steepest: Steepest,
) -> None:
    """Write the lowest rest plane at the corners, for every touchdown on a box of cells and every heading.

    Without contacts the gear rests on the plane of its footprint.

    Parameters
    ----------
    ground
        Ground of the box and a margin; its row and column are those of the south-west cell of the box.
    radius
        Radius of a footprint, in cells.
    fits
        Whether the gear stands at a heading; others are left out.
    corners
        (headings, 2 corners).
    floors
        (rows * cols, headings, corners) out, m in the heights of the ground; +inf for headings left out, and
        where the gear cannot rest.
    steepest
        (rows * cols, headings) out, greatest gradient of these planes.
    """
    lower, middle, upper, wide, row, col = ground
    floors[:] = np.inf
    steepest[:] = 0.0
    if contacts.shape[0] == 0:
        for place in range(rows * cols):
            plane = plane_of((lower, middle, upper, wide, row + place // cols, col + place % cols), radius)
            a, b = plane[1] / cell_m, plane[2] / cell_m
            for heading in range(corners.shape[0]):
                _lower(corners, heading, a, b, plane[0], floors[place, heading])
                steepest[place, heading] = math.sqrt(a * a + b * b)
        return
    scratch, line = scratch_for(contacts), int(limits[A_LINE])
    height, _, _, kept = scratch
    count = len(height)
    for place in range(rows * cols):
        here = lower, middle, upper, wide, row + place // cols, col + place % cols
        plane = plane_of(here, radius)
        for own in range(contacts.shape[0]):
            wanted = False
            for heading in range(own, corners.shape[0], contacts.shape[0]):
                wanted = wanted or fits[heading]
            if not wanted:
                continue
            edges = contact_heights(here, plane, cell_m, contacts, own, limits, noise_m, scratch)
            if edges < 0:
                continue
            for sides in range(-1, 1 << PARTS):  # -1: at the mean heights
                if sides >= 0:
                    if edges == 0 or sides & ~edges != 0:
                        continue
                    put_at_edges(scratch, sides, line)
                n = 0
                for first in range(0, count, line):
                    n = upper_hull(height, first, first + line, kept, n)
                _lower_to_rests(contacts, own, height, kept, n, corners, place, floors, steepest)
