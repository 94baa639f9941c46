"""Inner simplification of polygon rings: fewer vertices, by moves that only remove area."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Strided1D, Strided2D
from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part

Points = Strided2D[np.float64]
Indices = Strided1D[np.int64]
Offer = tuple[float, int, int, int]  # price, vertex or ring, kind, version at the time of the offer
Move = tuple[float, float, float, float, float]  # area removed, then up to two points that are inserted

CUT, EXTEND, TILT, DROP = 0, 1, 2, 3
NO_MOVE = (np.inf, 0.0, 0.0, 0.0, 0.0)
SAME = 1e-7  # cells: points closer than this are equal
ON = 1e-7  # square cells: twice the triangle area below which a point is on a side
HALVINGS = 10  # bisections of the range of a tilt: the area is flat near its minimum
AFFECTED_VERTICES = 4  # vertices to either side whose moves a move changes
CELLS_SHARE = 0.5  # share of cells in a move's price; the rest is area


@kernel_part
def _cross(ax: float, ay: float, bx: float, by: float) -> float:
    return ax * by - ay * bx


@kernel_part
def _turn(at: Points, a: int, b: int, c: int) -> float:
    """Return twice the signed area of a triangle: positive for a left turn, that is a convex vertex."""
    return _cross(at[b, 0] - at[a, 0], at[b, 1] - at[a, 1], at[c, 0] - at[b, 0], at[c, 1] - at[b, 1])


@kernel_part
def _meet(
    bx: float, by: float, ux: float, uy: float, cx: float, cy: float, vx: float, vy: float
) -> tuple[float, float]:
    """Return s and t with b + s u = c + t v; NaN for parallels."""
    across = _cross(ux, uy, vx, vy)
    if abs(across) < 1e-12:
        return np.nan, np.nan
    return _cross(cx - bx, cy - by, vx, vy) / across, _cross(cx - bx, cy - by, ux, uy) / across


@kernel_part
def _same(at: Points, i: int, x: float, y: float) -> bool:
    return bool(abs(at[i, 0] - x) + abs(at[i, 1] - y) < SAME)


@kernel_part
def _cut(at: Points, before: Indices, after: Indices, count: int, i: int) -> Move:
    """Remove a convex vertex: the chord of its neighbours replaces it."""
    twice = _turn(at, before[i], i, after[i])
    if count <= 3 or twice < -1e-12:
        return NO_MOVE
    return max(twice, 0.0) / 2, 0.0, 0.0, 0.0, 0.0


@kernel_part
def _extend(at: Points, before: Indices, after: Indices, count: int, b: int) -> Move:
    """Remove the edge from b: the adjacent edges are extended at its reflex ends until they meet."""
    a, c = before[b], after[b]
    d = after[c]
    at_b, at_c = _turn(at, a, b, c), _turn(at, b, c, d)
    if count <= 3 or (at_b >= 0 and at_c >= 0):
        return NO_MOVE
    ux, uy, vx, vy = at[b, 0] - at[a, 0], at[b, 1] - at[a, 1], at[d, 0] - at[c, 0], at[d, 1] - at[c, 1]
    s, t = _meet(at[b, 0], at[b, 1], ux, uy, at[c, 0], at[c, 1], vx, vy)
    ahead = s > 0 if at_b < 0 else -1 - 1e-9 <= s <= 0
    astern = t < 0 if at_c < 0 else 0 <= t <= 1 + 1e-9
    if not (ahead and astern):
        return NO_MOVE
    x, y = at[b, 0] + s * ux, at[b, 1] + s * uy
    if count == 4 and (_same(at, a, x, y) or _same(at, d, x, y)):
        return NO_MOVE
    return (
        abs(_cross(at[c, 0] - at[b, 0], at[c, 1] - at[b, 1], x - at[b, 0], y - at[b, 1])) / 2,
        x,
        y,
        0.0,
        0.0,
    )


@kernel_part
def _tilt(at: Points, before: Indices, after: Indices, count: int, v: int) -> Move:
    """Remove a reflex vertex between convex ones: one line through it replaces its two edges.

    The line ends on the adjacent edges. It removes the least area if the vertex halves it.
    """
    u, w = before[v], after[v]
    a, b = before[u], after[w]
    if count <= 3 or _turn(at, u, v, w) >= 0 or _turn(at, a, u, v) <= 0 or _turn(at, v, w, b) <= 0:
        return NO_MOVE
    ux, uy, wx, wy = at[a, 0] - at[u, 0], at[a, 1] - at[u, 1], at[b, 0] - at[w, 0], at[b, 1] - at[w, 1]
    vx, vy = at[w, 0] - at[v, 0], at[w, 1] - at[v, 1]
    straight, _ = _meet(at[u, 0], at[u, 1], ux, uy, at[v, 0], at[v, 1], vx, vy)
    low, high = 0.0, min(1.0, straight) if straight > 0 else 1.0
    best = -1.0
    for step in range(HALVINGS):
        s = high if step == 0 else (low + high) / 2
        px, py = at[u, 0] + s * ux, at[u, 1] + s * uy
        r, t = _meet(at[v, 0], at[v, 1], at[v, 0] - px, at[v, 1] - py, at[w, 0], at[w, 1], wx, wy)
        meets = r > 0 and -1e-9 <= t <= 1 + 1e-9
        if step == 0 and not meets:
            return NO_MOVE
        if meets:
            best, end = s, t
        if meets and r <= 1:
            high = s
        elif step == 0:
            break
        else:
            low = s
    px, py, qx, qy = at[u, 0] + best * ux, at[u, 1] + best * uy, at[w, 0] + end * wx, at[w, 1] + end * wy
    if count - 1 - int(_same(at, a, px, py)) - int(_same(at, b, qx, qy)) < 3:
        return NO_MOVE
    first = abs(_cross(at[v, 0] - at[u, 0], at[v, 1] - at[u, 1], px - at[u, 0], py - at[u, 1]))
    second = abs(_cross(at[v, 0] - at[w, 0], at[v, 1] - at[w, 1], qx - at[w, 0], qy - at[w, 1]))
    return (first + second) / 2, px, py, qx, qy


@kernel_part
def _move(at: Points, before: Indices, after: Indices, count: int, kind: int, i: int) -> Move:
    if kind == CUT:
        return _cut(at, before, after, count, i)
    if kind == EXTEND:
        return _extend(at, before, after, count, i)
    return _tilt(at, before, after, count, i)


@kernel_part
def _centres_in_triangle(
    sums: Strided2D[np.int32], ax: float, ay: float, bx: float, by: float, cx: float, cy: float
) -> int:
    """Return how many cells have their centre in or on a triangle, from cumulative sums along rows."""
    xs, ys = (ax, bx, cx, ax), (ay, by, cy, ay)
    first = max(int(np.ceil(min(ay, by, cy) - 0.5 - SAME)), 0)
    last = min(int(np.floor(max(ay, by, cy) - 0.5 + SAME)), sums.shape[0] - 1)
    found = 0
    for row in range(first, last + 1):
        y = min(max(row + 0.5, min(ay, by, cy)), max(ay, by, cy))
        west, east = np.inf, -np.inf
        for k in range(3):
            low, high = min(ys[k], ys[k + 1]), max(ys[k], ys[k + 1])
            if low <= y <= high:
                share = (y - ys[k]) / (ys[k + 1] - ys[k]) if high > low else 0.0
                x = xs[k] + share * (xs[k + 1] - xs[k])
                west, east = min(west, x), max(east, x)
                if high == low:
                    west, east = min(west, xs[k + 1]), max(east, xs[k + 1])
        start = max(int(np.ceil(west - 0.5 - SAME)), 0)
        stop = min(int(np.floor(east - 0.5 + SAME)) + 1, sums.shape[1] - 1)
        if stop > start:
            found += sums[row, stop] - sums[row, start]
    return found


@kernel_part
def _centres_removed(
    sums: Strided2D[np.int32], at: Points, before: Indices, after: Indices, kind: int, i: int, move: Move
) -> int:
    """Return how many cell centres a move removes."""
    _, x0, y0, x1, y1 = move
    p, q = before[i], after[i]
    if kind == CUT:
        return int(_centres_in_triangle(sums, at[p, 0], at[p, 1], at[i, 0], at[i, 1], at[q, 0], at[q, 1]))
    if kind == EXTEND:
        return int(_centres_in_triangle(sums, at[i, 0], at[i, 1], at[q, 0], at[q, 1], x0, y0))
    first = _centres_in_triangle(sums, at[p, 0], at[p, 1], at[i, 0], at[i, 1], x0, y0)
    return int(first + _centres_in_triangle(sums, at[q, 0], at[q, 1], at[i, 0], at[i, 1], x1, y1))


@kernel_part
def _price(area: float, cells: float) -> float:
    return (1 - CELLS_SHARE) * area + CELLS_SHARE * cells


@kernel_part
def _holds_no_vertex(at: Points, live: Indices, x: float, y: float, a: int, b: int, c: int, end: int) -> bool:
    """Return whether the triangle a, b, (x, y) holds no vertex but a, b, c, and `end` if it is at (x, y)."""
    ax, ay, bx, by = at[a, 0], at[a, 1], at[b, 0], at[b, 1]
    west, east = min(ax, bx, x) - SAME, max(ax, bx, x) + SAME
    south, north = min(ay, by, y) - SAME, max(ay, by, y) + SAME
    for j in live:
        px, py = at[j, 0], at[j, 1]
        if px < west or px > east or py < south or py > north:
            continue
        if j in (a, b, c) or (j == end and _same(at, j, x, y)):
            continue
        first = _cross(bx - ax, by - ay, px - ax, py - ay)
        second = _cross(x - bx, y - by, px - bx, py - by)
        third = _cross(ax - x, ay - y, px - x, py - y)
        if min(first, second, third) >= -ON or max(first, second, third) <= ON:
            return False
    return True


@kernel_part
def _crossed(at: Points, live: Indices, after: Indices, i: int, x: float, y: float, skip: int) -> bool:
    """Return whether an edge crosses the line from vertex i to (x, y), except edges at i and from `skip`."""
    ux, uy = x - at[i, 0], y - at[i, 1]
    for j in live:
        k = after[j]
        if j in (i, skip) or k == i:
            continue
        vx, vy = at[k, 0] - at[j, 0], at[k, 1] - at[j, 1]
        first = _cross(ux, uy, at[j, 0] - at[i, 0], at[j, 1] - at[i, 1])
        second = _cross(ux, uy, at[k, 0] - at[i, 0], at[k, 1] - at[i, 1])
        third = _cross(vx, vy, at[i, 0] - at[j, 0], at[i, 1] - at[j, 1])
        fourth = _cross(vx, vy, x - at[j, 0], y - at[j, 1])
        if first * second <= 0 and third * fourth <= 0:
            return True
    return False


@kernel_part
def _is_free(
    at: Points, live: Indices, before: Indices, after: Indices, kind: int, i: int, move: Move
) -> bool:
    """Return whether the area that a move removes holds no vertex, so that rings stay simple and disjoint."""
    _, x0, y0, x1, y1 = move
    p, q = before[i], after[i]
    if kind == CUT:
        return bool(_holds_no_vertex(at, live, at[q, 0], at[q, 1], p, i, q, q))
    if kind == TILT:
        first = _holds_no_vertex(at, live, x0, y0, p, i, i, before[p])
        return bool(first and _holds_no_vertex(at, live, x1, y1, q, i, i, after[q]))
    d = after[q]
    ends_back = _turn(at, p, i, q) >= 0
    if not _holds_no_vertex(at, live, x0, y0, i, q, q, p if ends_back else d):
        return False
    if ends_back or _turn(at, i, q, d) >= 0:
        return True
    # Both edges grow: only here can an edge cross the triangle's tip without a vertex inside.
    return not (_crossed(at, live, after, i, x0, y0, q) or _crossed(at, live, after, q, x0, y0, p))


@kernel_part
def _apply_move(
    at: Points, before: Indices, after: Indices, kind: int, i: int, move: Move
) -> tuple[int, int, int]:
    """Insert a move's points and return the vertices to remove, -1 for none."""
    _, x0, y0, x1, y1 = move
    p, q = before[i], after[i]
    if kind == CUT:
        return i, -1, -1
    if kind == EXTEND:
        at[i, 0], at[i, 1] = x0, y0
        onto = _same(at, p, x0, y0) or _same(at, after[q], x0, y0)
        return q, i if onto else -1, -1
    at[p, 0], at[p, 1], at[q, 0], at[q, 1] = x0, y0, x1, y1
    return i, p if _same(at, before[p], x0, y0) else -1, q if _same(at, after[q], x1, y1) else -1


@kernel_part
def _remove_vertex(before: Indices, after: Indices, live: Indices, place: Indices, n: int, i: int) -> int:
    """Remove a vertex from its ring and from the first n of `live`; return n - 1."""
    after[before[i]], before[after[i]] = after[i], before[i]
    last = live[n - 1]
    live[place[i]], place[last] = last, place[i]
    place[i] = -1
    return n - 1


@kernel_for_any_types
def _push_moves(
    heap: list[Offer],
    sums: NDArray[np.int32],
    at: Points,
    before: Indices,
    after: Indices,
    count: int,
    version: Indices,
    i: int,
) -> None:
    """Push a vertex's moves onto the heap."""
    for kind in range(DROP):
        move = _move(at, before, after, count, kind, i)
        if move[0] < np.inf:
            cells = _centres_removed(sums, at, before, after, kind, i, move)
            heapq.heappush(heap, (_price(move[0], cells), i, kind, version[i]))


@kernel_for_any_types
def _push_ring(heap: list[Offer], worth: Points, count: Indices, r: int) -> None:
    """Push the removal of a ring onto the heap, at its price per point."""
    if count[r] and worth[r, 0] < np.inf:
        heapq.heappush(heap, (_price(worth[r, 0], worth[r, 1]) / count[r], r, DROP, count[r]))


@kernel_part
def _in_order(at: Points, after: Indices, place: Indices, first: Indices, n: int) -> Points:
    """Return the n remaining vertices in ring order: (n, 3) ring, column, row."""
    out = np.empty((n, 3))
    filled = 0
    for r in range(len(first) - 1):
        start = first[r]
        while start < first[r + 1] and place[start] < 0:
            start += 1
        if start == first[r + 1]:
            continue
        i = start
        while True:
            out[filled, 0], out[filled, 1], out[filled, 2] = r, at[i, 0], at[i, 1]
            filled += 1
            i = after[i]
            if i == start:
                break
    return out


@kernel
def simplify_inside(
    points: Points,
    ring: Indices,
    worth: Points,
    sums: Strided2D[np.int32],
    most_area: float,
    most_cells: float,
    enough: int,
) -> Points:
    """Return simplified rings whose inside is within that of the given rings.

    The cheapest move comes first, by the area and the cells that it removes: a convex vertex is cut off, an
    edge is removed and the adjacent edges are extended until they meet, a reflex vertex is removed by tilting
    the line through it, or a ring is dropped. A move whose area holds a vertex of any ring is not made.

    Parameters
    ----------
    points
        (n, 2) columns and rows, ring by ring, each with its inside to the left.
    ring
        (n,) ring of each point, from 0, in order.
    worth
        (rings, 2) area and cells; infinite for rings that may not be dropped.
    sums
        Cumulative sums of the set cells along rows, from a column of 0.
    most_area, most_cells
        Bounds on what all moves together remove.
    enough
        Number of points at which the simplification stops.

    Returns
    -------
    (m, 3) ring, column, row.
    """
    n, rings = len(points), len(worth)
    at, worth = points.copy(), worth.copy()
    live, place = np.arange(n), np.arange(n)
    before, after = live - 1, live + 1
    count, version = np.bincount(ring, minlength=rings), np.zeros(n, np.int64)
    first = np.concatenate((np.zeros(1, np.int64), np.cumsum(count)))
    for r in range(rings):
        before[first[r]], after[first[r + 1] - 1] = first[r + 1] - 1, first[r]
    area_left, cells_left, moved = most_area, most_cells, True
    while moved and n > enough:  # again, because what blocked a move may be gone
        moved = False
        heap = [(0.0, 0, DROP, -1)]
        for r in range(rings):
            _push_ring(heap, worth, count, r)
        for k in range(n):
            _push_moves(heap, sums, at, before, after, count[ring[live[k]]], version, live[k])
        while len(heap) and n > enough:
            _, i, kind, stamp = heapq.heappop(heap)
            if kind == DROP:
                if count[i] == stamp and worth[i, 0] <= area_left and worth[i, 1] <= cells_left:
                    for j in range(first[i], first[i + 1]):
                        if place[j] >= 0:
                            n = _remove_vertex(before, after, live, place, n, j)
                    area_left, cells_left = area_left - worth[i, 0], cells_left - worth[i, 1]
                    count[i], moved = 0, True
                continue
            if place[i] < 0 or version[i] != stamp:
                continue
            r = ring[i]
            move = _move(at, before, after, count[r], kind, i)
            cells = _centres_removed(sums, at, before, after, kind, i, move)
            if move[0] > area_left or cells > cells_left:
                continue
            if not _is_free(at, live[:n], before, after, kind, i, move):
                continue
            near = before[before[i]]
            for gone in _apply_move(at, before, after, kind, i, move):
                if gone >= 0:
                    n = _remove_vertex(before, after, live, place, n, gone)
                    count[r] -= 1
            area_left, cells_left, moved = area_left - move[0], cells_left - cells, True
            worth[r, 0], worth[r, 1] = worth[r, 0] - move[0], worth[r, 1] - cells
            _push_ring(heap, worth, count, r)
            while place[near] < 0:
                near = before[near]
            for _ in range(AFFECTED_VERTICES):
                near = before[near]
            for _ in range(2 * AFFECTED_VERTICES + 2):
                version[near] += 1
                _push_moves(heap, sums, at, before, after, count[r], version, near)
                near = after[near]
    return _in_order(at, after, place, first, n)
