"""Rest planes of the gear for every touchdown on a cell, and every yaw about a heading.

The vehicle touches down anywhere on a cell, and misses its heading by some degrees. Its poses are a box: an
interval of places to the east, one to the north, and one of yaws. While the vehicle is somewhere in a box, a
contact is somewhere in a rectangle, and rests somewhere between the lowest and the highest ground of the
cells that this meets. Where a gear may tip over within these bounds, the box is halved across its longest
side, down to `FINEST` of a cell (branch and bound): a heading is kept only if every part of its boxes is.

What is fixed to the vehicle, such as rotor and tail, tilts with the gear, and is as high as the lowest of the
planes on which it may rest. Their minimum is a concave function of the place, so that within a rectangle it
is nowhere below the bilinear interpolation of its values at the four corners.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.footprint.rest_pose import (
    A_BELLY,
    A_CLEARANCE,
    A_GRADIENT,
    A_LEVERAGE,
    A_LINE,
    A_PAD,
    FARTHEST_RING,
    NOWHERE,
    PARTS,
    TOUCHES_M,
    Contacts,
    GearLimits,
    Ground,
    Plane,
    Rest,
    Scratch,
    Undercarriage,
    ground_of_box,
    part_of,
    plane_of,
    rest_on,
    scratch_for,
    upper_hull,
)
from slz.kernels.jit import kernel, kernel_part

RECTANGLES = 2  # of rotor and tail
CORNERS = 4 * RECTANGLES
FINEST = 0.25  # of a cell: sides of the smallest boxes
DEEPEST = 64  # boxes that wait to be looked at
LOWER, FIRST, LAST, UPPER = range(4)  # contacts of a part that are at the upper side of their edges
EDGE_SIGMAS = 6.0  # as in `rest_pose`, of tens of returns more: a pad may meet a hundred cells in all poses
MOST_PLANES = 2048  # on which a gear may rest in one box; with more, it counts as tipping over
# Box of poses: middle east and north of that of the touchdown's cell, yaw beyond the heading, and half its
# sides (m, m, rad).
Box = tuple[float, float, float, float, float, float]
B_EAST, B_NORTH, B_YAW, B_HALF_EAST, B_HALF_NORTH, B_HALF_YAW = range(6)
# East and north of the corners from the centre of gravity at each heading (m), flat.
Corners = Array2D[np.float64]
Planes = Array2D[np.float64]  # rise to the east and to the north, and height at the centre of gravity
Waiting = Array2D[np.float64]  # boxes
Work = tuple[Contacts, Scratch, Planes, Waiting]
Floors = Array3D[np.float64]
Steepest = Array2D[np.float64]


@kernel_part
def _turn(contacts: Contacts, heading: int, yaw: float, turned: Contacts) -> None:
    """Write the contacts at a heading and a yaw beyond it, clockwise."""
    sine, cosine = math.sin(yaw), math.cos(yaw)
    for i in range(contacts.shape[1]):
        east, north = float(contacts[heading, i, 0]), float(contacts[heading, i, 1])
        turned[0, i, 0] = east * cosine + north * sine
        turned[0, i, 1] = north * cosine - east * sine


@kernel_part
def _swept_ground(
    ground: Ground, plane: Plane, row: float, col: float, tall: float, wide: float
) -> tuple[float, float, float]:
    """Return lowest, mean and highest ground over a plane of the cells that a rectangle meets.

    Of the nearest cells where these hold no return; the mean is NaN without any. Middle and half sides in
    cells.
    """
    row0, row1 = math.floor(row - tall + 0.5), math.floor(row + tall + 0.5)
    col0, col1 = math.floor(col - wide + 0.5), math.floor(col + wide + 0.5)
    for ring in range(FARTHEST_RING + 1):
        found = ground_of_box(ground, plane, row0 - ring, row1 + ring, col0 - ring, col1 + ring)
        if not np.isnan(found[1]):
            return found
    return found


@kernel_part
def _contact_bounds(
    ground: Ground, plane: Plane, cell_m: float, gear: Undercarriage, box: Box, edge_m: float
) -> int:
    """Write the mean, lowest and highest ground that each contact may rest on in a box of poses.

    Return the parts of the gear at an edge, a bit each; -1 where a contact has no ground. Lowest and highest
    differ from the mean at edges only: where ground of more than noise and slope lies between them.
    """
    turned, limits, (height, low, high, _) = gear
    sine, versed = math.sin(box[B_HALF_YAW]), 1 - math.cos(box[B_HALF_YAW])
    line, edges = int(limits[A_LINE]), 0
    for i in range(turned.shape[1]):
        east, north = float(turned[0, i, 0]), float(turned[0, i, 1])
        tall = box[B_HALF_NORTH] + limits[A_PAD] + abs(east) * sine + abs(north) * versed
        wide = box[B_HALF_EAST] + limits[A_PAD] + abs(north) * sine + abs(east) * versed
        col, row = (box[B_EAST] + east) / cell_m, (box[B_NORTH] + north) / cell_m
        least, mean, most = _swept_ground(
            ground, plane, ground[4] + row, ground[5] + col, tall / cell_m, wide / cell_m
        )
        if np.isnan(mean):
            return -1
        level = plane[0] + plane[1] * col + plane[2] * row
        height[i], low[i], high[i] = level + mean, level + mean, level + mean
        if most - least > edge_m:
            low[i], high[i] = level + least, level + most
            edges |= 1 << part_of(i, line)
    return edges


@kernel_part
def _is_belly_clear(
    ground: Ground, plane: Plane, highest: float, cell_m: float, limits: GearLimits, box: Box, rest: Rest
) -> bool:
    """Return whether no ground under the belly reaches up to it, anywhere in a box of poses.

    highest: ground over the plane of all cells that the belly may be over.
    """
    belly, clearance = float(limits[A_BELLY]), float(limits[A_CLEARANCE])
    east, north = box[B_EAST] / cell_m, box[B_NORTH] / cell_m
    a, b = plane[1] / cell_m, plane[2] / cell_m
    there = plane[0] + plane[1] * east + plane[2] * north
    beyond = abs(rest[1] - a) * box[B_HALF_EAST] + abs(rest[2] - b) * box[B_HALF_NORTH]
    if highest + there - rest[3] + math.hypot(rest[1] - a, rest[2] - b) * belly + beyond <= clearance:
        return True
    _, _, upper, wide, row, col = ground
    half_row, half_col = 0.5 + box[B_HALF_NORTH] / cell_m, 0.5 + box[B_HALF_EAST] / cell_m
    radius, tall = belly / cell_m, len(upper) // wide
    reach = math.ceil(radius + 1.5)
    for dr in range(-reach, reach + 1):
        for dc in range(-reach, reach + 1):
            r, c = row + dr, col + dc
            y, x = max(0.0, abs(dr - north) - half_row), max(0.0, abs(dc - east) - half_col)
            if y * y + x * x < radius * radius and 0 <= r < tall and 0 <= c < wide:
                level = rest[1] * (dc - east) * cell_m + rest[2] * (dr - north) * cell_m + rest[3]
                if upper[r * wide + c] - level + beyond > clearance:
                    return False
    return True


@kernel_part
def _planes_at(
    ground: Ground,
    plane: Plane,
    highest: float,
    cell_m: float,
    gear: Undercarriage,
    box: Box,
    planes: Planes,
    found: int,
) -> int:
    """Append the planes on which a gear can rest at its heights; return how many there are now.

    Return -1 where there is none, or where one is beyond the tip limit or has ground up to the belly.
    """
    turned, limits, (height, _, _, kept) = gear
    line, before = int(limits[A_LINE]), found
    n = split = 0
    for first in range(0, len(height), line):
        split = n  # first of the last line
        n = upper_hull(height, first, first + line, kept, n)
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                if line > 1 and not (j == i + 1 and j < split <= k) and not (i < split <= j and k == j + 1):
                    continue  # on a line, only neighbours of its hull can both touch
                rest = rest_on(turned, 0, height, kept, n, kept[i], kept[j], kept[k])
                if rest[0] == NOWHERE:
                    continue
                if rest[0] > limits[A_GRADIENT] or found == len(planes):
                    return -1
                if not _is_belly_clear(ground, plane, highest, cell_m, limits, box, rest):
                    return -1
                planes[found, 0], planes[found, 1], planes[found, 2] = rest[1], rest[2], rest[3]
                found += 1
    return found if found > before else -1


@kernel_part
def _may_tip(plane: Plane, cell_m: float, gear: Undercarriage, box: Box) -> bool:
    """Return whether contacts at any heights within their bounds might tilt the gear beyond its limit."""
    turned, limits, (_, low, high, _) = gear
    least, most = np.inf, -np.inf
    for i in range(len(low)):
        col, row = (box[B_EAST] + turned[0, i, 0]) / cell_m, (box[B_NORTH] + turned[0, i, 1]) / cell_m
        level = plane[0] + plane[1] * col + plane[2] * row
        least, most = min(least, low[i] - level), max(most, high[i] - level)
    gradient = math.hypot(plane[1], plane[2]) / cell_m
    return bool(gradient + (most - least) * limits[A_LEVERAGE] > limits[A_GRADIENT])


@kernel_part
def _differs(sides: int, edges: int, uneven: bool) -> bool:
    """Return whether no other sides give the same heights, see `_put_at_edges`.

    edges: bits of the parts at edges. uneven: whether contacts alone at the upper side are tried.
    """
    for part in range(PARTS):
        side = sides >> 2 * part & 3
        if (side != LOWER and not edges >> part & 1) or (side in (FIRST, LAST) and not uneven):
            return False
    return True


@kernel_part
def _put_at_edges(scratch: Scratch, sides: int, line: int) -> None:
    """Write the heights of the contacts at edges, by two bits of `sides` for each part of the gear.

    All of a part are at the lower or the upper side of their edges, or the first or the last one alone is at
    the upper side: an object under one end of a skid tilts it more than one under half of it.
    """
    height, low, high, _ = scratch
    count, before, after = len(height), 0, 0
    for i in range(count):
        part = part_of(i, line)
        if low[i] < high[i]:
            side, first = sides >> 2 * part & 3, before >> part & 1 == 0
            height[i] = high[i] if side == UPPER or (side == FIRST and first) else low[i]
            before |= 1 << part
    for i in range(count - 1, -1, -1):
        part = part_of(i, line)
        if low[i] < high[i]:
            if sides >> 2 * part & 3 == LAST and after >> part & 1 == 0:
                height[i] = high[i]
            after |= 1 << part


@kernel_part
def _planes_in(
    ground: Ground,
    plane: Plane,
    highest: float,
    cell_m: float,
    gear: Undercarriage,
    box: Box,
    edge_m: float,
    planes: Planes,
) -> int:
    """Write the planes on which a gear may rest in a box of poses; return how many, or -1 as `_planes_at`."""
    edges, found, line = _contact_bounds(ground, plane, cell_m, gear, box, edge_m), 0, int(gear[1][A_LINE])
    if edges < 0:
        return -1
    uneven = line > 1 and _may_tip(plane, cell_m, gear, box)
    for sides in range(1 << 2 * PARTS):
        if found >= 0 and _differs(sides, edges, uneven):
            if edges != 0:
                _put_at_edges(gear[2], sides, line)
            found = _planes_at(ground, plane, highest, cell_m, gear, box, planes, found)
    return found


@kernel_part
def _lower_floors(
    planes: Planes,
    count: int,
    plane: Plane,
    cell_m: float,
    box: Box,
    corners: Corners,
    own: int,
    period: int,
    floors: Floors,
    steepest: Steepest,
    place: int,
) -> None:
    """Lower the floors of a place to planes, at all headings that leave the gear the same.

    Within a box, a plane moves with the ground's own slope.
    """
    for i in range(count):
        a, b = planes[i, 0], planes[i, 1]
        moved = abs(a - plane[1] / cell_m) * box[B_HALF_EAST] + abs(b - plane[2] / cell_m) * box[B_HALF_NORTH]
        level = planes[i, 2] - a * box[B_EAST] - b * box[B_NORTH] - moved
        gradient = math.sqrt(a * a + b * b)
        for heading in range(own, corners.shape[0], period):
            steepest[place, heading] = max(steepest[place, heading], gradient)
            for k in range(CORNERS):
                floor = a * corners[heading, 2 * k] + b * corners[heading, 2 * k + 1] + level
                floors[place, heading, k] = min(floors[place, heading, k], floor)


@kernel_part
def _halved(waiting: Waiting, count: int, box: Box, reach_m: float) -> int:
    """Append both halves of a box of poses, cut across its longest side; return how many boxes wait."""
    east, north, turn = box[B_HALF_EAST], box[B_HALF_NORTH], box[B_HALF_YAW] * reach_m
    side = B_YAW if turn > max(east, north) else B_NORTH if north > east else B_EAST
    half = side + B_HALF_EAST - B_EAST
    for sign in (-1, 1):
        for k in range(len(box)):
            waiting[count, k] = box[k]
        waiting[count, half] = box[half] / 2
        waiting[count, side] = box[side] + sign * box[half] / 2
        count += 1
    return count


@kernel_part
def _stands_on_cell(
    ground: Ground,
    plane: Plane,
    highest: float,
    cell_m: float,
    contacts: Contacts,
    own: int,
    limits: GearLimits,
    edge_m: float,
    yaw_error: float,
    work: Work,
    corners: Corners,
    floors: Floors,
    steepest: Steepest,
    place: int,
) -> bool:
    """Return whether the gear stands in all poses on a cell about a heading, and lower the floors to them."""
    turned, scratch, planes, waiting = work
    reach_m, half_m, period = float(limits[A_BELLY]), 0.5 * cell_m, contacts.shape[0]
    finest_m = 0.5 * FINEST * cell_m * (1 + 1e-6)
    for k in range(waiting.shape[1]):
        waiting[0, k] = 0.0
    waiting[0, B_HALF_EAST], waiting[0, B_HALF_NORTH], waiting[0, B_HALF_YAW] = half_m, half_m, yaw_error
    count = 1
    while count > 0:
        count -= 1
        box = (
            waiting[count, 0], waiting[count, 1], waiting[count, 2],
            waiting[count, 3], waiting[count, 4], waiting[count, 5],
        )  # fmt: skip
        _turn(contacts, own, box[B_YAW], turned)
        gear = turned, limits, scratch
        found = _planes_in(ground, plane, highest, cell_m, gear, box, edge_m, planes)
        if found > 0:
            _lower_floors(planes, found, plane, cell_m, box, corners, own, period, floors, steepest, place)
        elif max(box[B_HALF_EAST], box[B_HALF_NORTH], box[B_HALF_YAW] * reach_m) <= finest_m:
            return False
        else:
            count = _halved(waiting, count, box, reach_m)
    return True


@kernel_part
def _bounds_under(ground: Ground, plane: Plane, reach: int) -> tuple[float, float, bool]:
    """Return the lowest and the highest ground over a plane within a square of cells; whether it has gaps."""
    lower, middle, upper, wide, row, col = ground
    low, high, tall, gaps = np.inf, -np.inf, len(lower) // wide, False
    for r in range(row - reach, row + reach + 1):
        for c in range(col - reach, col + reach + 1):
            at = r * wide + c
            if not (0 <= r < tall and 0 <= c < wide) or lower[at] == NOWHERE:
                gaps = True
                continue
            level = plane[0] + plane[1] * (c - col) + plane[2] * (r - row)
            low, high = min(low, lower[at] - level), max(high, max(upper[at], middle[at]) - level)
    return low, high, gaps


@kernel
def rests_anyhow(
    ground: Ground,
    radius: int,
    rows: int,
    cols: int,
    cell_m: float,
    limits: GearLimits,
    corners: Corners,
    floors: Floors,
    steepest: Steepest,
) -> bool:
    """Return whether a box of cells is so even that the gear stands on it in any pose, and bound its floors.

    What it bounds is never above what `keep_rests` finds, and takes no search. See there for the parameters.
    """
    lower, middle, upper, wide, row, col = ground
    belly, leverage = float(limits[A_BELLY]), float(limits[A_LEVERAGE])
    under, aside_m = math.ceil((belly + limits[A_PAD]) / cell_m + 1), cell_m * math.sqrt(0.5)
    for place in range(rows * cols):
        here = lower, middle, upper, wide, row + place // cols, col + place % cols
        plane = plane_of(here, radius)
        a, b = plane[1] / cell_m, plane[2] / cell_m
        low, high, gaps = _bounds_under(here, plane, under)
        tilt, gradient = max(0.0, high - low) * leverage, math.sqrt(a * a + b * b)
        if gaps or not gradient + tilt <= limits[A_GRADIENT]:  # NaN without a plane
            return False
        if high - low + tilt * (belly + aside_m) > limits[A_CLEARANCE]:
            return False
        for heading in range(corners.shape[0]):
            steepest[place, heading] = gradient + tilt
            for k in range(CORNERS):
                east, north = corners[heading, 2 * k], corners[heading, 2 * k + 1]
                away_m = math.sqrt(east * east + north * north) + aside_m
                floors[place, heading, k] = a * east + b * north + plane[0] + low - tilt * away_m
    return True


@kernel
def highest_floors(
    ground: Ground,
    radius: int,
    rows: int,
    cols: int,
    cell_m: float,
    limits: GearLimits,
    corners: Corners,
    floors: Floors,
) -> None:
    """Write floors that are never below what `keep_rests` finds, and take no search. See there.

    At the centre of gravity, which is between its contacts, the gear is at most as high over the footprint's
    plane as the highest ground that they reach. From there it rises by what its leverage makes of the relief,
    or by its limit.
    """
    lower, middle, upper, wide, row, col = ground
    limit, under = float(limits[A_GRADIENT]), math.ceil((limits[A_BELLY] + limits[A_PAD]) / cell_m + 1)
    level_plane = 0.0, 0.0, 0.0
    for place in range(rows * cols):
        here = lower, middle, upper, wide, row + place // cols, col + place % cols
        plane = plane_of(here, radius)
        gradient = math.sqrt(plane[1] ** 2 + plane[2] ** 2) / cell_m
        low, high, gaps = _bounds_under(here, plane, under)
        tilt = min((high - low) * limits[A_LEVERAGE], limit + gradient)
        if gaps or np.isnan(gradient):
            plane, tilt = level_plane, limit
            _, high, _ = _bounds_under(here, plane, under + FARTHEST_RING)
        for heading in range(corners.shape[0]):
            for k in range(CORNERS):
                east, north = corners[heading, 2 * k], corners[heading, 2 * k + 1]
                rise = (plane[1] * east + plane[2] * north) / cell_m + tilt * math.sqrt(east**2 + north**2)
                floors[place, heading, k] = plane[0] + high + rise + TOUCHES_M


@kernel
def keep_rests(
    ground: Ground,
    radius: int,
    rows: int,
    cols: int,
    cell_m: float,
    contacts: Contacts,
    limits: GearLimits,
    noise_m: float,
    yaw_error: float,
    fits: Array1D[np.bool_],
    corners: Corners,
    floors: Floors,
    steepest: Steepest,
) -> None:
    """Clear the headings at which the gear may not stand somewhere on a box of cells, and write its floors.

    Without contacts the gear rests on the plane of its footprint.

    Parameters
    ----------
    ground
        Ground of the box and a margin; its row and column are those of the south-west cell of the box.
    radius
        Radius of a footprint, in cells.
    noise_m
        Standard deviation of the height of one return.
    yaw_error
        Angle by which the vehicle may miss a heading (rad).
    fits
        One flag for each heading around; those that are cleared already are left out.
    corners
        (headings, 2 corners); no headings where no floors are wanted.
    floors
        (rows * cols, headings, corners) out, lowest rest plane, m in the heights of the ground, for a vehicle
        whose centre of gravity is over the middle of the cell; +inf for headings left out.
    steepest
        (rows * cols, headings) out, greatest gradient of these planes.
    """
    lower, middle, upper, wide, row, col = ground
    floors[:] = np.inf
    steepest[:] = 0.0
    scratch, period = scratch_for(contacts), contacts.shape[0]
    turned = np.empty((1, contacts.shape[1], 2), np.float32)
    work = turned, scratch, np.empty((MOST_PLANES, 3)), np.empty((DEEPEST, 6))
    under = math.ceil((limits[A_BELLY] + limits[A_PAD]) / cell_m + 1)
    for place in range(rows * cols):
        r, c = row + place // cols, col + place % cols
        here = lower, middle, upper, wide, r, c
        plane = plane_of(here, radius)
        a, b = plane[1] / cell_m, plane[2] / cell_m
        if period == 0:
            for heading in range(corners.shape[0]):
                steepest[place, heading] = math.sqrt(a * a + b * b)
                for k in range(CORNERS):
                    floors[place, heading, k] = (
                        a * corners[heading, 2 * k] + b * corners[heading, 2 * k + 1] + plane[0]
                    )
            continue
        edge_m = math.hypot(EDGE_SIGMAS * noise_m, abs(plane[1]) + abs(plane[2]))
        highest = ground_of_box(here, plane, r - under, r + under, c - under, c + under)[2]
        for own in range(period):
            wanted = False
            for heading in range(own, len(fits), period):
                wanted = wanted or fits[heading]
            if wanted and not _stands_on_cell(
                here, plane, highest, cell_m, contacts, own, limits, edge_m, yaw_error, work,
                corners, floors, steepest, place,
            ):  # fmt: skip
                for heading in range(own, len(fits), period):
                    fits[heading] = False
