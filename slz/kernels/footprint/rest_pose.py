"""Rest pose of the landing gear on the cells of a footprint.

The gear touches the ground at contacts: pads, or points along skids. A pad rests on the mean height of the
cells under it. Where these hold an edge, it may as well stand at the upper or the lower side of the edge. The
vehicle rests on three contacts around its centre of gravity, with no other contact below the ground. Where
two such triples exist, or a pad is at an edge, the steepest pose counts.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array3D, Float32
from slz.kernels.cells.cell_record import IS_SAFE, IS_UNSAFE
from slz.kernels.footprint.certainty import CERTAIN_SIGMAS, normal_cdf
from slz.kernels.footprint.plane_fit import LEVEL, NOISE2, NORTH, RELIEF, SLOPE, WEST
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.raster.bitmap import NONE, ONE, lowest, signed
from slz.kernels.simd import LANES, broadcast, flags_of, load, sqrt

AROUND = -1e-4  # least barycentric coordinate of a centre of gravity within a triple of contacts
TOUCHES_M = 1e-4
FINE = 0.5  # of the distance between skids: in wider cells the place of an edge says nothing of their halves
PARTS = 4  # of a gear, whose edges are tried at both sides independently
EDGE_SIGMAS = 5.0  # standard deviations of a return: what differs less under a pad is no edge
FARTHEST_RING = 4  # cells around a contact without a return, in which its ground is sought
CLEAR_SIGMAS = 2.0  # standard deviations of a gradient within its limit, from which no other heading is tried
NOISES_OF_RELIEF = np.float32(2)  # by which noise may exaggerate a relief, in deviations of one return
LEAST_CERTAINTY = np.float32(0.5)  # of an unsafe cell; below, it is not refined
NOWHERE = np.float32(np.inf)  # gradient of a gear that cannot rest

# Contacts of one line (a skid; 1 for pads); greatest gradient of the plane through the contacts; height of
# the belly over that plane (m); radius of the belly and of a pad (m); greatest gradient that a relief of 1 m
# can add; gradient of a slope of 1 degree.
GearLimits = tuple[Float32, Float32, Float32, Float32, Float32, Float32, Float32]
A_LINE, A_GRADIENT, A_CLEARANCE, A_BELLY, A_PAD, A_LEVERAGE, A_DEGREE = range(7)
Row = Array1D[np.float32]
Contacts = Array3D[np.float32]
Rest = tuple[float, float, float, float]  # gradient, its east and north parts, height below the centre (m)
# Height at the middle of the footprint, rise to the east and to the north per cell (m).
Plane = tuple[float, float, float]
# Lowest, mean and highest ground of the cells (m), flat; cells in a row; row and column of the footprint.
# Unknown cells are +inf, anything and -inf.
Ground = tuple[Row, Row, Row, int, int, int]
Scratch = tuple[Row, Row, Row, Array1D[np.int64]]
Undercarriage = tuple[Contacts, GearLimits, Scratch]


@kernel_part
def ground_of_box(
    ground: Ground, plane: Plane, row0: int, row1: int, col0: int, col1: int
) -> tuple[float, float, float]:
    """Return lowest, mean and highest ground over a plane in a box of cells; the mean is NaN without any."""
    lower, middle, upper, wide, row, col = ground
    low, high, total, count = np.inf, -np.inf, 0.0, 0
    for r in range(max(0, row0), min(len(lower) // wide, row1 + 1)):
        north = plane[2] * (r - row)
        for c in range(max(0, col0), min(wide, col1 + 1)):
            at = np.uint64(r * wide + c)  # unsigned: no check for negative indices
            if lower[at] < NOWHERE:
                level = plane[0] + plane[1] * (c - col) + north
                low, high = min(low, lower[at] - level), max(high, upper[at] - level)
                total += middle[at] - level
                count += 1
    return low, total / count if count else np.nan, high


@kernel_part
def ground_under(
    ground: Ground, plane: Plane, north: float, east: float, pad: float, edge_m: float
) -> tuple[float, float, float]:
    """Return lowest, mean and highest ground under a pad, of the nearest cells where it has no return.

    Where the cells around it hold no edge, the mean is theirs too: it is less noisy.

    Parameters
    ----------
    north, east, pad
        Place from the middle of the footprint, and radius, in cells. The heights are over the plane.
    """
    row, col = ground[4] + north, ground[5] + east
    row0, row1 = math.floor(row - pad + 0.5), math.floor(row + pad + 0.5)
    col0, col1 = math.floor(col - pad + 0.5), math.floor(col + pad + 0.5)
    around = ground_of_box(ground, plane, row0 - 1, row1 + 1, col0 - 1, col1 + 1)
    if not np.isnan(around[1]) and around[2] - around[0] <= edge_m:
        return around
    own = ground_of_box(ground, plane, row0, row1, col0, col1)
    for ring in range(2, FARTHEST_RING + 1):
        if not np.isnan(own[1]):
            return own
        own = around
        around = ground_of_box(ground, plane, row0 - ring, row1 + ring, col0 - ring, col1 + ring)
        if not np.isnan(around[1]) and around[2] - around[0] <= edge_m:
            return around
    return around if np.isnan(own[1]) else own


@kernel_part
def upper_hull(heights: Row, first: int, stop: int, kept: Array1D[np.int64], n: int) -> int:
    """Append those contacts of an evenly divided line that can touch the ground; return how many are kept."""
    begin = n
    for i in range(first, stop):
        while n - begin >= 2:
            p, q = kept[n - 2], kept[n - 1]
            if (heights[q] - heights[p]) * (i - p) > (heights[i] - heights[p]) * (q - p):
                break
            n -= 1
        kept[n] = i
        n += 1
    return n


@kernel_part
def rest_on(
    contacts: Contacts, heading: int, heights: Row, kept: Array1D[np.int64], n: int, p: int, q: int, s: int
) -> Rest:
    """Return the plane through three contacts on which the gear rests; an infinite gradient if it does not.

    It rests where the centre of gravity is within the three and no other contact is below the ground. See
    `steepest_rest` for the parameters.
    """
    x0, y0 = float(contacts[heading, p, 0]), float(contacts[heading, p, 1])
    x1, y1 = contacts[heading, q, 0] - x0, contacts[heading, q, 1] - y0
    x2, y2 = contacts[heading, s, 0] - x0, contacts[heading, s, 1] - y0
    area = x1 * y2 - x2 * y1
    if abs(area) < 1e-9:
        return np.inf, 0.0, 0.0, 0.0
    second, third = (x2 * y0 - x0 * y2) / area, (x0 * y1 - x1 * y0) / area
    if min(second, third, 1 - second - third) < AROUND:
        return np.inf, 0.0, 0.0, 0.0
    rise1, rise2 = float(heights[q] - heights[p]), float(heights[s] - heights[p])
    a, b = (rise1 * y2 - rise2 * y1) / area, (x1 * rise2 - x2 * rise1) / area
    c = heights[p] - a * x0 - b * y0
    for m in range(n):
        t = kept[m]
        if heights[t] - (a * contacts[heading, t, 0] + b * contacts[heading, t, 1] + c) > TOUCHES_M:
            return np.inf, 0.0, 0.0, 0.0
    return math.sqrt(a * a + b * b), a, b, c


@kernel_part
def steepest_rest(contacts: Contacts, heading: int, heights: Row, kept: Array1D[np.int64], n: int) -> Rest:
    """Return the steepest plane on which a gear can rest: gradient, its east and north parts, and height.

    The gradient is negative where the centre of gravity is within no triple of contacts.

    Parameters
    ----------
    contacts, heading
        (headings, contacts, 2) east and north of the contacts from the centre of gravity, m.
    heights
        Ground under the contacts, m.
    kept, n
        The first n are the contacts that can touch.
    """
    steepest, east, north, up = -1.0, 0.0, 0.0, 0.0
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                rest = rest_on(contacts, heading, heights, kept, n, kept[i], kept[j], kept[k])
                if steepest < rest[0] < np.inf:
                    steepest, east, north, up = rest
    return steepest, east, north, up


@kernel_part
def _is_clear(ground: Ground, cell_m: float, limits: GearLimits, rest: Rest) -> bool:
    """Return whether no ground under the belly reaches up to it."""
    _, _, upper, wide, row, col = ground
    belly, tall = limits[A_BELLY] / cell_m, len(upper) // wide
    reach = math.ceil(belly + 0.5)
    for dr in range(-reach, reach + 1):
        for dc in range(-reach, reach + 1):
            r, c = row + dr, col + dc
            y, x = max(0.0, abs(dr) - 0.5), max(0.0, abs(dc) - 0.5)  # nearest part of the cell
            if y * y + x * x < belly * belly and 0 <= r < tall and 0 <= c < wide:
                level = rest[1] * dc * cell_m + rest[2] * dr * cell_m + rest[3]
                if upper[r * wide + c] - level > limits[A_CLEARANCE]:
                    return False
    return True


@kernel_part
def _apart_m(contacts: Contacts, heading: int, line: int) -> float:
    """Return the distance between two skids."""
    east = contacts[heading, line, 0] - contacts[heading, 0, 0]
    return math.hypot(east, contacts[heading, line, 1] - contacts[heading, 0, 1])


@kernel_part
def part_of(contact: int, line: int) -> int:
    """Return the part of the gear that a contact belongs to: a pad, or half a skid."""
    return contact if line == 1 else 2 * (contact // line) + (2 * (contact % line) >= line)


@kernel_part
def _steepest_on_lines(
    contacts: Contacts, heading: int, heights: Row, kept: Array1D[np.int64], line: int
) -> Rest:
    """Return the steepest plane on which a gear of lines of contacts can rest, see `steepest_rest`."""
    n = 0
    for first in range(0, len(heights), line):
        n = upper_hull(heights, first, first + line, kept, n)
    return steepest_rest(contacts, heading, heights, kept, n)


@kernel_part
def contact_heights(
    ground: Ground, plane: Plane, cell_m: float, gear: Undercarriage, heading: int, noise_m: float
) -> int:
    """Write the mean, lowest and highest ground under each contact to the scratch arrays.

    Return the parts of the gear at an edge that must be tried at both sides, a bit each; -1 where a contact
    has no ground. Lowest and highest differ from the mean at edges only.
    """
    contacts, limits, (height, low, high, _) = gear
    count, line, edges = contacts.shape[1], int(limits[A_LINE]), 0
    rise_m = abs(plane[1]) + abs(plane[2])  # of the plane within a cell
    edge_m = math.hypot(EDGE_SIGMAS * noise_m, rise_m)
    for i in range(count):
        east, north = contacts[heading, i, 0] / cell_m, contacts[heading, i, 1] / cell_m
        least, mean, most = ground_under(ground, plane, north, east, limits[A_PAD] / cell_m, edge_m)
        if np.isnan(mean):
            return -1
        level = plane[0] + plane[1] * east + plane[2] * north
        height[i], low[i], high[i] = level + mean, level + mean, level + mean
        if most - least > edge_m:
            low[i], high[i] = level + least, level + most
            edges |= 1 << part_of(i, line)
    return edges if line == 1 or cell_m <= FINE * _apart_m(contacts, heading, line) else 0


@kernel_part
def put_at_edges(scratch: Scratch, sides: int, line: int) -> None:
    """Write the heights of the contacts at edges: upper side for the parts in `sides`, else the lower one."""
    height, low, high, _ = scratch
    for i in range(len(height)):
        if low[i] < high[i]:
            height[i] = high[i] if sides >> part_of(i, line) & 1 else low[i]


@kernel_part
def gradient_at(
    ground: Ground, plane: Plane, cell_m: float, gear: Undercarriage, heading: int, noise_m: float
) -> float:
    """Return the gradient at which a gear rests at a heading; infinite where it cannot rest.

    noise_m: standard deviation of the height of one return.
    """
    contacts, limits, scratch = gear
    line, (height, _, _, kept) = int(limits[A_LINE]), scratch
    edges = contact_heights(ground, plane, cell_m, gear, heading, noise_m)
    if edges < 0:
        return np.inf
    rest = _steepest_on_lines(contacts, heading, height, kept, line)
    if rest[0] < 0 or not _is_clear(ground, cell_m, limits, rest):
        return np.inf
    gradient = rest[0]
    if edges != 0:
        for sides in range(1 << PARTS):  # a bit for each part: at the upper side of its edges
            if sides & ~edges == 0 and gradient <= limits[A_GRADIENT]:
                put_at_edges(scratch, sides, line)
                gradient = max(gradient, _steepest_on_lines(contacts, heading, height, kept, line)[0])
    return gradient


@kernel_part
def _least_gradient(
    ground: Ground, plane: Plane, cell_m: float, gear: Undercarriage, noise_m: float, enough: float
) -> float:
    """Return the least gradient at which a gear rests, of all headings, or the first one below `enough`."""
    least = np.inf
    for heading in range(gear[0].shape[0]):
        least = min(least, gradient_at(ground, plane, cell_m, gear, heading, noise_m))
        if least <= enough:
            break
    return least


@kernel
def plane_of(ground: Ground, radius: int) -> Plane:
    """Return the least-squares plane of the mean heights of a footprint; NaN without one."""
    lower, middle, _, wide, row, col = ground
    n = sx = sy = sz = sxx = sxy = syy = sxz = syz = 0.0
    for r in range(row - radius, row + radius + 1):
        for c in range(col - radius, col + radius + 1):
            at = r * wide + c
            if lower[at] < NOWHERE:
                x, y, z = float(c - col), float(r - row), float(middle[at])
                n, sx, sy, sz = n + 1, sx + x, sy + y, sz + z
                sxx, sxy, syy, sxz, syz = sxx + x * x, sxy + x * y, syy + y * y, sxz + x * z, syz + y * z
    sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    sxz, syz, det = sxz - sx * sz / n, syz - sy * sz / n, sxx * syy - sxy * sxy
    a, b = (sxz * syy - syz * sxy) / det, (syz * sxx - sxz * sxy) / det
    return (sz - a * sx - b * sy) / n, a, b


@kernel_part
def scratch_for(contacts: Contacts) -> Scratch:
    """Return the arrays that `gradient_at` works in."""
    count = contacts.shape[1]
    height, low, high = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    return height, low, high, np.empty(count, np.int64)


@kernel_part
def refuse_without_heading(
    statistics: Row,
    at: int,
    planes: Row,
    to_plane: int,
    ground: Ground,
    cell_m: float,
    gear: Undercarriage,
    asked: np.uint64,
    before: tuple[Row, Array1D[np.uint8]],
    certainties: Row,
    to: int,
    states: Array1D[np.uint8],
    place: int,
) -> None:
    """Make those of 16 safe cells unsafe where the gear can stand at no heading, and adjust certainties.

    Footprints that are so even that no gear can tilt beyond its limit are not looked at.

    Parameters
    ----------
    statistics, at, planes, to_plane
        Plane statistics and planes, and index of the first, see `slz.kernels.footprint.plane_fit.fit_planes`.
    ground
        Ground under the first of the 16 cells.
    asked, before
        Mask of the cells to look at, and certainties and states of 16, which the others get back.
    certainties, to, states, place
        Certainties and states of the cells, and index of the first.
    """
    limits = gear[1]
    slope, relief = load(statistics, at + SLOPE * LANES), load(statistics, at + RELIEF * LANES)
    leverage, noise2 = limits[A_LEVERAGE], load(statistics, at + NOISE2 * LANES)
    relief = relief - broadcast(NOISES_OF_RELIEF) * sqrt(noise2)
    gradient = slope * broadcast(limits[A_DEGREE]) + relief * broadcast(leverage)
    rise = relief * broadcast(np.float32(1) + limits[A_BELLY] * leverage)
    tilts = flags_of(broadcast(limits[A_GRADIENT]) < gradient)  # False for NaN
    uneven = tilts | flags_of(broadcast(limits[A_CLEARANCE]) < rise)
    lower, middle, upper, wide, row, col = ground
    while uneven != NONE:
        i = signed(lowest(uneven))
        uneven &= uneven - ONE
        if (asked >> np.uint64(i)) & ONE == NONE:
            certainties[to + i], states[place + i] = before[0][i], before[1][i]
            continue
        if states[place + i] != IS_SAFE and certainties[to + i] < LEAST_CERTAINTY:
            continue
        plane = (
            float(planes[to_plane + LEVEL * LANES + i]),
            -float(planes[to_plane + WEST * LANES + i]),
            float(planes[to_plane + NORTH * LANES + i]),
        )
        limit, noise_m = float(limits[A_GRADIENT]), math.sqrt(statistics[at + NOISE2 * LANES + i])
        sigma = max(1e-3, noise_m * leverage)
        least = _least_gradient(
            (lower, middle, upper, wide, row, col + i), plane, cell_m, gear, noise_m,
            limit - CLEAR_SIGMAS * sigma,
        )  # fmt: skip
        left = (limit - least) / sigma
        if left < 0 and states[place + i] == IS_SAFE:
            states[place + i] = IS_UNSAFE
        if left < CERTAIN_SIGMAS:
            certainties[to + i] *= np.float32(normal_cdf(left))
