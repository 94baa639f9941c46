"""Ray casting: exact intersections, and grid traversal of a ray through a world.

A ray is ``origin + t * direction`` with a unit direction, so ``t`` is in metres. A hit is the first crossing
of a surface with t > 0, from outside or from inside. Misses are ``inf``.

Each cell of the grid lists the solids whose bounds touch it and stores the height of its highest ground and
of its highest object, so that a ray passes over most cells without any test. Movers are few: every ray tests
their bounding spheres first.
"""

from __future__ import annotations

import math

import numpy as np

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel, kernel_part
from sitl.world.hits import GROUND, MOVERS, NOTHING
from sitl.world.tables import F64, INF, GroundTable, MoverTable, OpaqueTable


@kernel_part
def _first(near: float, far: float) -> float:
    """Return the first of two ordered crossings that is ahead."""
    if near > 0.0:
        return near
    return far if far > 0.0 else INF


@kernel_part
def slab(origin: float, direction: float, low: float, high: float) -> tuple[float, float]:
    """Return the interval of t between two parallel planes, (inf, -inf) if the ray is never between them."""
    if direction == 0.0:
        return (-INF, INF) if low <= origin <= high else (INF, -INF)
    a = (low - origin) / direction
    b = (high - origin) / direction
    return (a, b) if a <= b else (b, a)


@kernel_part
def _box(p: F64, i: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    c, s = p[i, 6], p[i, 7]
    rx, ry = ox - p[i, 0], oy - p[i, 1]
    near, far = slab(oz, dz, p[i, 2], p[i, 3])
    a, b = slab(c * rx + s * ry, c * dx + s * dy, -p[i, 4], p[i, 4])
    near, far = max(near, a), min(far, b)
    a, b = slab(c * ry - s * rx, c * dy - s * dx, -p[i, 5], p[i, 5])
    near, far = max(near, a), min(far, b)
    return _first(near, far) if near <= far else INF


@kernel_part
def _cylinder(p: F64, i: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    rx, ry = ox - p[i, 0], oy - p[i, 1]
    near, far = slab(oz, dz, p[i, 2], p[i, 3])
    a = dx * dx + dy * dy
    c = rx * rx + ry * ry - p[i, 4] * p[i, 4]
    if a < 1e-18:
        return _first(near, far) if c <= 0.0 and near <= far else INF
    b = rx * dx + ry * dy
    discriminant = b * b - a * c
    if discriminant < 0.0:
        return INF
    root = math.sqrt(discriminant)
    near, far = max(near, (-b - root) / a), min(far, (-b + root) / a)
    return _first(near, far) if near <= far else INF


@kernel_part
def _ellipsoid(p: F64, i: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    rx, ry, rz = (ox - p[i, 0]) / p[i, 3], (oy - p[i, 1]) / p[i, 4], (oz - p[i, 2]) / p[i, 5]
    ex, ey, ez = dx / p[i, 3], dy / p[i, 4], dz / p[i, 5]
    a = ex * ex + ey * ey + ez * ez
    b = rx * ex + ry * ey + rz * ez
    discriminant = b * b - a * (rx * rx + ry * ry + rz * rz - 1.0)
    if discriminant < 0.0:
        return INF
    root = math.sqrt(discriminant)
    return _first((-b - root) / a, (-b + root) / a)


@kernel_part
def _wire(p: F64, i: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    ax, ay, az = p[i, 3] - p[i, 0], p[i, 4] - p[i, 1], p[i, 5] - p[i, 2]
    length2 = ax * ax + ay * ay + az * az
    rx, ry, rz = ox - p[i, 0], oy - p[i, 1], oz - p[i, 2]
    along_r = (rx * ax + ry * ay + rz * az) / length2
    along_d = (dx * ax + dy * ay + dz * az) / length2
    rx, ry, rz = rx - along_r * ax, ry - along_r * ay, rz - along_r * az
    ex, ey, ez = dx - along_d * ax, dy - along_d * ay, dz - along_d * az
    a = ex * ex + ey * ey + ez * ez
    if a < 1e-18:
        return INF
    b = rx * ex + ry * ey + rz * ez
    discriminant = b * b - a * (rx * rx + ry * ry + rz * rz - p[i, 6] * p[i, 6])
    if discriminant < 0.0:
        return INF
    root = math.sqrt(discriminant)
    near, far = (-b - root) / a, (-b + root) / a
    if near > 0.0 and 0.0 <= along_r + near * along_d <= 1.0:
        return float(near)
    return float(far) if far > 0.0 and 0.0 <= along_r + far * along_d <= 1.0 else INF


@kernel_part
def solid_hit(
    shape: int, p: F64, i: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> float:
    """Return the distance to solid i along one ray, inf for a miss."""
    if shape == 0:
        return _box(p, i, ox, oy, oz, dx, dy, dz)
    if shape == 1:
        return _cylinder(p, i, ox, oy, oz, dx, dy, dz)
    if shape == 2:
        return _ellipsoid(p, i, ox, oy, oz, dx, dy, dz)
    return _wire(p, i, ox, oy, oz, dx, dy, dz)


@kernel_part
def patch_hit(
    z: F64,
    j: int,
    i: int,
    u: float,
    v: float,
    du: float,
    dv: float,
    oz: float,
    dz: float,
    t0: float,
    t1: float,
) -> float:
    """Return the t at which a ray meets one bilinear square, for t in [t0, t1]; inf for a miss.

    (u, v) = u0 + t du is the position in the square; height above the surface is a quadratic in t.
    """
    b = z[j, i + 1] - z[j, i]
    c = z[j + 1, i] - z[j, i]
    d = z[j + 1, i + 1] - z[j + 1, i] - b
    q2 = -d * du * dv
    q1 = dz - b * du - c * dv - d * (u * dv + v * du)
    q0 = oz - z[j, i] - b * u - c * v - d * u * v
    above = q0 + t0 * (q1 + t0 * q2)
    if above <= 0.0:
        return t0
    if abs(q2) < 1e-14:
        t = -q0 / q1 if q1 != 0.0 else INF
        return t if t0 <= t <= t1 else INF
    discriminant = q1 * q1 - 4.0 * q2 * q0
    if discriminant < 0.0:
        return INF
    # Numerically stable form, without subtraction of two nearly equal numbers.
    q = -0.5 * (q1 + math.copysign(math.sqrt(discriminant), q1))
    ta = q / q2
    tb = q0 / q if q != 0.0 else INF
    if ta > tb:
        ta, tb = tb, ta
    if t0 <= ta <= t1:
        return float(ta)
    return float(tb) if t0 <= tb <= t1 else INF


@kernel_part
def solid_normal(shape: int, p: F64, i: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a normal (any length and sign) of solid i at a point on its surface."""
    if shape == 2:
        return (x - p[i, 0]) / p[i, 3] ** 2, (y - p[i, 1]) / p[i, 4] ** 2, (z - p[i, 2]) / p[i, 5] ** 2
    if shape == 3:
        ax, ay, az = p[i, 3] - p[i, 0], p[i, 4] - p[i, 1], p[i, 5] - p[i, 2]
        rx, ry, rz = x - p[i, 0], y - p[i, 1], z - p[i, 2]
        along = (rx * ax + ry * ay + rz * az) / (ax * ax + ay * ay + az * az)
        return rx - along * ax, ry - along * ay, rz - along * az
    if min(abs(z - p[i, 2]), abs(z - p[i, 3])) < 1e-6:
        return 0.0, 0.0, 1.0
    rx, ry = x - p[i, 0], y - p[i, 1]
    if shape == 1:
        return rx, ry, 0.0
    c, s = p[i, 6], p[i, 7]
    on_end = abs(abs(c * rx + s * ry) - p[i, 4]) < abs(abs(c * ry - s * rx) - p[i, 5])
    return (c, s, 0.0) if on_end else (-s, c, 0.0)


@kernel_part
def ground_square(ground: GroundTable, x: float, y: float) -> tuple[int, int, float, float]:
    """Return row, column and the position within the square of the ground under (x, y)."""
    z, _, meta = ground
    u, v = (x - meta[0]) / meta[2], (y - meta[1]) / meta[2]
    i = min(max(math.floor(u), 0), z.shape[1] - 2)
    j = min(max(math.floor(v), 0), z.shape[0] - 2)
    return j, i, u - i, v - j


@kernel_part
def ground_normal(ground: GroundTable, x: float, y: float) -> tuple[float, float, float]:
    j, i, u, v = ground_square(ground, x, y)
    z, post = ground[0], ground[2][2]
    gx = (z[j, i + 1] - z[j, i]) * (1 - v) + (z[j + 1, i + 1] - z[j + 1, i]) * v
    gy = (z[j + 1, i] - z[j, i]) * (1 - u) + (z[j + 1, i + 1] - z[j, i + 1]) * u
    return -gx / post, -gy / post, 1.0


@kernel_part
def ground_hit(
    ground: GroundTable,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    t0: float,
    t1: float,
) -> float:
    """Return the t at which a ray meets the ground, square by square over t in [t0, t1]; inf for a miss."""
    z, _, meta = ground
    rows, columns = z.shape[0] - 1, z.shape[1] - 1
    post = meta[2]
    u, v = (ox - meta[0]) / post, (oy - meta[1]) / post
    du, dv = dx / post, dy / post
    i = min(max(math.floor(u + t0 * du), 0), columns - 1)
    j = min(max(math.floor(v + t0 * dv), 0), rows - 1)
    step_i, step_j = (1 if du > 0 else -1), (1 if dv > 0 else -1)
    next_u = (i + (du > 0) - u) / du if du != 0.0 else INF
    next_v = (j + (dv > 0) - v) / dv if dv != 0.0 else INF
    t = t0
    while True:
        leave = min(next_u, next_v, t1)
        if leave >= t:
            hit = patch_hit(z, j, i, u - i, v - j, du, dv, oz, dz, t, leave)
            if hit != INF:
                return hit
            t = leave
        if leave >= t1:
            return INF
        if next_u <= next_v:
            i += step_i
            next_u += abs(1.0 / du)
        else:
            j += step_j
            next_v += abs(1.0 / dv)
        if i < 0 or j < 0 or i >= columns or j >= rows:
            return INF


@kernel_part
def _movers_hit(
    movers: MoverTable, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, int]:
    shapes, rows, _, spheres = movers
    best, which = limit, -1
    for i in range(shapes.size):
        rx, ry, rz = spheres[i, 0] - ox, spheres[i, 1] - oy, spheres[i, 2] - oz
        along = rx * dx + ry * dy + rz * dz
        radius = spheres[i, 3]
        if along < -radius or rx * rx + ry * ry + rz * rz - along * along > radius * radius:
            continue
        t = solid_hit(shapes[i], rows, i, ox, oy, oz, dx, dy, dz)
        if t < best:
            best, which = t, i
    return best, which


@kernel_part
def first_hit(
    tables: OpaqueTable,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    limit: float,
    thin_m: float,
) -> tuple[float, int, int]:
    """Return (t, what, index): what is 0 nothing, 1 ground, 2 solid, 3 mover; t is NaN for nothing.

    Wires of a radius up to `thin_m` are passed over; a negative one passes over none.
    """
    ground, solids, grid, movers = tables
    meta, ground_top, any_top, start, item = grid
    shapes, rows, _ = solids
    if not math.isfinite(ox + oy + oz + dx + dy + dz):
        return math.nan, 0, 0
    cell, x0, y0 = meta[0], ground[2][0], ground[2][1]
    best, index = _movers_hit(movers, ox, oy, oz, dx, dy, dz, limit)
    what = 3 if index >= 0 else 0
    t, t_end = slab(oz, dz, meta[1], meta[2])
    a, b = slab(ox, dx, x0, x0 + (ground[0].shape[1] - 1) * ground[2][2])
    t, t_end = max(t, a), min(t_end, b)
    a, b = slab(oy, dy, y0, y0 + (ground[0].shape[0] - 1) * ground[2][2])
    t, t_end = max(0.0, t, a), min(best, t_end, b)
    if t > t_end:
        return best if what else math.nan, what, index
    n_y, n_x = any_top.shape
    ix = min(max(math.floor((ox + t * dx - x0) / cell), 0), n_x - 1)
    iy = min(max(math.floor((oy + t * dy - y0) / cell), 0), n_y - 1)
    next_x = (x0 + (ix + (dx > 0)) * cell - ox) / dx if dx != 0.0 else INF
    next_y = (y0 + (iy + (dy > 0)) * cell - oy) / dy if dy != 0.0 else INF
    while True:
        leave = min(next_x, next_y, t_end)
        lowest = oz + dz * (leave if dz < 0.0 else t)
        if lowest <= any_top[iy, ix]:
            if lowest <= ground_top[iy, ix]:
                enter = t
                if dz < 0.0:  # skip the part above every post of the cell
                    enter = max(t, (ground_top[iy, ix] - oz) / dz)
                hit = ground_hit(ground, ox, oy, oz, dx, dy, dz, enter, max(enter, leave))
                if hit < best:
                    best, what, index = hit, 1, 0
            flat = iy * n_x + ix
            for k in range(start[flat], start[flat + 1]):
                s = item[k]
                if shapes[s] == 3 and rows[s, 6] <= thin_m:
                    continue
                hit = solid_hit(shapes[s], rows, s, ox, oy, oz, dx, dy, dz)
                if hit < best:
                    best, what, index = hit, 2, s
        if best <= leave or leave >= t_end:
            return best if what else math.nan, what, index
        t = max(t, leave)
        if next_x <= next_y:
            ix += 1 if dx > 0 else -1
            next_x += cell / abs(dx)
        else:
            iy += 1 if dy > 0 else -1
            next_y += cell / abs(dy)
        if ix < 0 or iy < 0 or ix >= n_x or iy >= n_y:
            return best if what else math.nan, what, index


@kernel_part
def surface_hit(
    tables: OpaqueTable,
    what: int,
    index: int,
    t: float,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
) -> tuple[int, float, int]:
    """Return material, cosine of the angle of incidence and the code of ``hits`` of a `first_hit`."""
    ground, solids, _, movers = tables
    if what == 0:
        return 0, 0.0, NOTHING
    x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
    if what == 1:
        j, i, _, _ = ground_square(ground, x, y)
        kind, hit = ground[1][j, i], GROUND
        nx, ny, nz = ground_normal(ground, x, y)
    elif what == 2:
        kind, hit = solids[2][index], index
        nx, ny, nz = solid_normal(solids[0][index], solids[1], index, x, y, z)
    else:
        kind, hit = movers[2][index], MOVERS + index
        nx, ny, nz = solid_normal(movers[0][index], movers[1], index, x, y, z)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return kind, abs(nx * dx + ny * dy + nz * dz) / length if length > 0.0 else 0.0, hit


@kernel
def cast_rays(
    tables: OpaqueTable,
    origins: Array2D[np.float64],
    directions: Array2D[np.float64],
    limit: float,
    thin_m: float,
    out_range: Array1D[np.float64],
    out_kind: Array1D[np.uint8],
    out_cosine: Array1D[np.float64],
    out_hit: Array1D[np.int64],
) -> None:
    """Cast every ray; write range (NaN for none), material, cosine of the angle of incidence and ``hits``.

    `thin_m` as in `first_hit`.
    """
    for n in range(origins.shape[0]):
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        t, what, index = first_hit(tables, ox, oy, oz, dx, dy, dz, limit, thin_m)
        out_range[n] = t
        out_kind[n], out_cosine[n], out_hit[n] = surface_hit(tables, what, index, t, ox, oy, oz, dx, dy, dz)
