"""Beams against thin wires: the share of each beam that a wire in its footprint covers.

The cross-section of a beam is a Gaussian of two widths, cut off at `CUT` standard deviations. The share that
a straight wire covers has a closed form: that of a strip as wide as the wire. Its brightness as a Lambertian
tube is reflectance x pi / 4 x the sine of the angle between wire and beam, the mean cosine over its width.

Cells of a grid list the pieces of wire that a footprint over the cell may touch. The range of a wire is that
of the closest approach of beam and axis, so a piece counts in one cell only, whichever lists it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel, kernel_part
from sitl.world.raycast import slab
from sitl.world.tables import F64, INF, WireTable

I64 = NDArray[np.int64]
SLOTS = 3
"""Wires at different ranges of one beam that return an echo; further ones only shade."""
CUT = 3.0
TOGETHER_M = 0.3
"""Pieces nearer than this to one another along a beam are one wire, or one bundle."""
MARGIN_M = 0.5
"""Greatest distance from the axis of a beam at which a wire counts."""
_STEEPEST = 1e-3  # least square of the sine between wire and beam: a wire end on is no target
_PER_FWHM = 1.0 / 2.3548200450309493


@kernel_part
def _normal(x: float) -> float:
    """Return the cumulative distribution of the standard normal."""
    return 0.5 * math.erfc(-x * 0.7071067811865476)


@kernel_part
def covered(
    h: float, s0: float, s1: float, radius: float, nx: float, ny: float, sigma_x: float, sigma_y: float
) -> float:
    """Return the share of a beam that a piece of wire covers.

    h: signed distance of its axis from the beam's, along the unit normal (nx, ny). s0, s1: places of its ends
    along (ny, -nx). sigma_x, sigma_y: standard deviations of the beam in these axes.
    """
    vx, vy = sigma_x * sigma_x, sigma_y * sigma_y
    across2 = vx * nx * nx + vy * ny * ny
    across = math.sqrt(across2)
    if abs(h) - radius > CUT * across:
        return 0.0
    share = _normal((h + radius) / across) - _normal((h - radius) / across)
    # Along the wire the beam is a Gaussian too, about a centre that depends on the place across.
    both = (vx - vy) * nx * ny
    centre = both / across2 * min(max(0.0, h - radius), h + radius)
    along = sigma_x * sigma_y / across
    return share * (_normal((s1 - centre) / along) - _normal((s0 - centre) / along))


@kernel_part
def _piece(
    rows: F64,
    i: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    up: tuple[float, float, float],
    beam: F64,
    enter: float,
    leave: float,
) -> tuple[float, float, float]:
    """Return range, share and brightness of piece i in a beam; share 0 for none between enter and leave."""
    ax, ay, az = rows[i, 3] - rows[i, 0], rows[i, 4] - rows[i, 1], rows[i, 5] - rows[i, 2]
    rx, ry, rz = rows[i, 0] - ox, rows[i, 1] - oy, rows[i, 2] - oz
    length2 = ax * ax + ay * ay + az * az
    a_d, a_r, d_r = ax * dx + ay * dy + az * dz, ax * rx + ay * ry + az * rz, dx * rx + dy * ry + dz * rz
    sine2 = 1.0 - a_d * a_d / length2
    if sine2 < _STEEPEST:
        return 0.0, 0.0, 0.0
    t = (d_r - a_d * a_r / length2) / sine2
    if t < enter or t >= leave or t <= 0.0:
        return 0.0, 0.0, 0.0
    # Axes of the cross-section: "across" is level in the sensor's frame, "upward" completes the frame.
    cx, cy, cz = up[1] * dz - up[2] * dy, up[2] * dx - up[0] * dz, up[0] * dy - up[1] * dx
    flat = math.sqrt(cx * cx + cy * cy + cz * cz)
    if flat < 1e-9:
        cx, cy, cz, flat = 1.0, 0.0, 0.0, 1.0
    cx, cy, cz = cx / flat, cy / flat, cz / flat
    ux, uy, uz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx
    wide_x = ax * cx + ay * cy + az * cz
    wide_y = ax * ux + ay * uy + az * uz
    seen = math.sqrt(wide_x * wide_x + wide_y * wide_y)
    tx, ty = wide_x / seen, wide_y / seen
    nx, ny = -ty, tx
    px, py, pz = rx - t * dx, ry - t * dy, rz - t * dz
    start_x, start_y = px * cx + py * cy + pz * cz, px * ux + py * uy + pz * uz
    h, s0 = start_x * nx + start_y * ny, start_x * tx + start_y * ty
    sigma_x = _PER_FWHM * (beam[0] + beam[2] * t)
    sigma_y = _PER_FWHM * (beam[1] + beam[3] * t)
    radius = rows[i, 6]
    if abs(h) - radius > MARGIN_M:
        return 0.0, 0.0, 0.0
    # `covered` measures along (ny, -nx), which is (tx, ty).
    share = covered(h, s0, s0 + seen, radius, nx, ny, sigma_x, sigma_y)
    return t - radius, share, share * rows[i, 7] * 0.25 * math.pi * math.sqrt(sine2)


@kernel_part
def _add(
    n: int,
    t: float,
    share: float,
    bright: float,
    index: int,
    strongest: F64,
    out_range: F64,
    out_share: F64,
    out_bright: F64,
    out_index: I64,
) -> None:
    """Add an echo to those of beam n: to one at its range, or as another."""
    for k in range(SLOTS):
        if out_share[n, k] == 0.0:
            out_range[n, k], out_share[n, k], out_bright[n, k] = t, share, bright
            out_index[n, k], strongest[k] = index, bright
            return
        if abs(out_range[n, k] - t) <= TOGETHER_M:
            whole = out_bright[n, k] + bright
            out_range[n, k] += (t - out_range[n, k]) * bright / whole
            out_share[n, k] += share
            out_bright[n, k] = whole
            if bright > strongest[k]:
                out_index[n, k], strongest[k] = index, bright
            return


@kernel
def cast_wires(
    wires: WireTable,
    origins: Array2D[np.float64],
    directions: Array2D[np.float64],
    ups: Array2D[np.float64],
    ends: Array1D[np.float64],
    limit: float,
    beam: Array1D[np.float64],
    strongest: Array1D[np.float64],
    out_range: Array2D[np.float64],
    out_share: Array2D[np.float64],
    out_bright: Array2D[np.float64],
    out_index: Array2D[np.int64],
) -> None:
    """Cast every beam at the wires before its end.

    Parameters
    ----------
    ups
        (n, 3) axis of the sensor in the world, which with the direction gives the axes of the cross-section.
    ends
        (n,) range of the opaque surface, NaN for none.
    beam
        Widths at the sensor, level and upward (m), and their growth (rad); full, at half maximum.
    strongest
        (`SLOTS`,) room for the brightest piece of each echo of a beam.
    out_range, out_share, out_bright, out_index
        (n, `SLOTS`) of the echoes, shares 0 for none: written only where there is one. The index is that of
        the brightest piece.
    """
    rows, index, meta, low, top, start, item = wires
    cell, x0, y0 = meta[0], meta[1], meta[2]
    n_y, n_x = low.shape
    for n in range(origins.shape[0]):
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        end = limit if math.isnan(ends[n]) else ends[n]
        if not math.isfinite(ox + oy + oz + dx + dy + dz):
            continue
        t, t_end = slab(oz, dz, meta[3], meta[4])
        a, b = slab(ox, dx, x0, x0 + n_x * cell)
        t, t_end = max(t, a), min(t_end, b)
        a, b = slab(oy, dy, y0, y0 + n_y * cell)
        t, t_end = max(0.0, t, a), min(end, t_end, b)
        if t >= t_end:
            continue
        up = (ups[n, 0], ups[n, 1], ups[n, 2])
        ix = min(max(math.floor((ox + t * dx - x0) / cell), 0), n_x - 1)
        iy = min(max(math.floor((oy + t * dy - y0) / cell), 0), n_y - 1)
        next_x = (x0 + (ix + (dx > 0)) * cell - ox) / dx if dx != 0.0 else INF
        next_y = (y0 + (iy + (dy > 0)) * cell - oy) / dy if dy != 0.0 else INF
        while True:
            leave = min(next_x, next_y, t_end)
            z0, z1 = oz + t * dz, oz + leave * dz
            if min(z0, z1) <= top[iy, ix] and max(z0, z1) >= low[iy, ix]:
                flat = iy * n_x + ix
                for k in range(start[flat], start[flat + 1]):
                    i = item[k]
                    at, share, bright = _piece(rows, i, ox, oy, oz, dx, dy, dz, up, beam, t, leave)
                    if share > 0.0:
                        _add(
                            n,
                            at,
                            share,
                            bright,
                            index[i],
                            strongest,
                            out_range,
                            out_share,
                            out_bright,
                            out_index,
                        )
            if leave >= t_end:
                break
            t = max(t, leave)
            if next_x <= next_y:
                ix += 1 if dx > 0 else -1
                next_x += cell / abs(dx)
            else:
                iy += 1 if dy > 0 else -1
                next_y += cell / abs(dy)
            if ix < 0 or iy < 0 or ix >= n_x or iy >= n_y:
                break
        for k in range(SLOTS if out_share[n, 0] > 0.0 else 0):
            shade = 0.0  # of the wires before this one
            for j in range(SLOTS):
                if out_range[n, j] < out_range[n, k]:
                    shade += out_share[n, j]
            out_bright[n, k] *= min(max(1.0 - shade, 0.0), 1.0)
