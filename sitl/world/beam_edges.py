"""Beams that an edge divides: part of one meets the near surface, the rest what is behind.

A beam is Gaussian, taken as one ray in its middle and `RING` rays around it, weighted so that the variance is
that of the beam. Two opposite rays of the ring look for an edge first: on a plane, however oblique, the sum
of their ranges is twice that of the middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel, kernel_part
from sitl.world.primitives import REFLECTANCE
from sitl.world.raycast import first_hit, surface_hit
from sitl.world.tables import OpaqueTable
from sitl.world.wires import THIN_M, Beam
from sitl.world.world import Crossings, World

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Flags = NDArray[np.bool_]

RING = 6
MIDDLE_SHARE = 0.25
RING_SHARE = (1.0 - MIDDLE_SHARE) / RING
RING_SIGMAS = float(np.sqrt(2.0 / (1.0 - MIDDLE_SHARE)))
"""Radius of the ring in standard deviations of the beam."""
SHARES: F64 = np.array([MIDDLE_SHARE, *[RING_SHARE] * RING])
TURNS = (0, RING // 2, *(turn for turn in range(RING) if turn % (RING // 2)))
"""Places round the ring, from that of the first ray that looks for an edge, in the order of the rays."""
_ANGLES = [2.0 * math.pi / RING * turn for turn in range(RING + RING // 2)]
COSINE, SINE = np.array([math.cos(a) for a in _ANGLES]), np.array([math.sin(a) for a in _ANGLES])
SIGMA_PER_WIDTH = float(1.0 / np.sqrt(8.0 * np.log(2.0)))
EDGE_M = 0.05
"""Departure from a plane that counts as an edge."""


@dataclass(frozen=True, slots=True)
class EdgeEchoes:
    """Echoes of beams that an edge divides.

    at: (k,) of all beams. range_m, bright: (k, 1 + `RING`), range NaN for none. hit: codes of ``hits``.
    """

    at: I64
    range_m: F64
    bright: F64
    hit: I64


def edge_echoes(
    world: World,
    middle: Crossings,
    rays: tuple[F64, F64, F64],
    index: I64,
    known: Flags | None,
    beam: Beam,
    limit_m: float,
    time_s: F64,
) -> EdgeEchoes:
    """Return the echoes of the beams with an edge inside.

    Parameters
    ----------
    world, middle
        The world, and what the rays in the middle meet.
    rays
        (n, 3) origins, unit directions and the sensor's up, ENU.
    index
        (n,) number of each pulse; the pair of rays that looks for an edge follows from it.
    known
        (n,) mask of beams that are left out, None for none.
    beam
        Widths of the beam.
    limit_m
        Greatest range; also that at which the width of a beam counts that meets nothing in the middle.
    time_s
        (n,) times of the beams.
    """
    n = len(index)
    origins, directions, ups = (np.ascontiguousarray(values) for values in rays)
    skipped = np.zeros(n, np.bool_) if known is None else known
    widths = np.array([*beam.exit_m, *beam.divergence_rad])
    at, range_m, cosine = np.empty(n, np.int64), np.empty((n, 1 + RING)), np.empty((n, 1 + RING))
    kind, hit = np.empty((n, 1 + RING), np.uint8), np.empty((n, 1 + RING), np.int64)
    found = at, range_m, kind, cosine, hit
    count = 0
    for cut, tables in world.opaque(time_s, n):
        beams = origins, directions, ups, middle.range_m, index, skipped
        count = cast_edges(tables, *beams, cut.start or 0, cut.stop, widths, limit_m, THIN_M, count, *found)
    at, range_m, kind, cosine, hit = at[:count], range_m[:count], kind[:count], cosine[:count], hit[:count]
    range_m[:, 0], kind[:, 0] = middle.range_m[at], middle.kind[at]
    cosine[:, 0], hit[:, 0] = middle.cosine[at], middle.hit[at]
    return EdgeEchoes(at, range_m, SHARES * (REFLECTANCE[kind] * cosine), hit)


@kernel_part
def _ring_ray(
    axes: tuple[tuple[float, float, float], tuple[float, float, float]],
    level: float,
    upward: float,
    turn: int,
) -> tuple[float, float, float]:
    """Return a unit vector beside the first of two axes; `level` and `upward` are the radii of the ring."""
    (dx, dy, dz), (lx, ly, lz) = axes
    aside, up = level * COSINE[turn], upward * SINE[turn]
    x = dx + aside * lx + up * (ly * dz - lz * dy)
    y = dy + aside * ly + up * (lz * dx - lx * dz)
    z = dz + aside * lz + up * (lx * dy - ly * dx)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@kernel
def cast_edges(
    tables: OpaqueTable,
    origins: Array2D[np.float64],
    directions: Array2D[np.float64],
    ups: Array2D[np.float64],
    middle_m: Array1D[np.float64],
    index: Array1D[np.int64],
    skipped: Array1D[np.bool_],
    begin: int,
    end: int,
    widths: Array1D[np.float64],
    limit_m: float,
    thin_m: float,
    count: int,
    out_at: Array1D[np.int64],
    out_range: Array2D[np.float64],
    out_kind: Array2D[np.uint8],
    out_cosine: Array2D[np.float64],
    out_hit: Array2D[np.int64],
) -> int:
    """Look for edges in the beams from `begin` to `end`, and write what the ring of divided ones meets.

    `widths` are those of ``Beam``: level and upward at the exit, then per range. Rows are written from
    `count` on; the number of all is returned. The middle's column stays open.
    """
    for n in range(begin, end):
        if skipped[n]:
            continue
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        lx = dy * ups[n, 2] - dz * ups[n, 1]
        ly = dz * ups[n, 0] - dx * ups[n, 2]
        lz = dx * ups[n, 1] - dy * ups[n, 0]
        length = max(math.sqrt(lx * lx + ly * ly + lz * lz), 1e-9)
        lx, ly, lz = lx / length, ly / length, lz / length
        at_m = max(middle_m[n], 0.1) if math.isfinite(middle_m[n]) else limit_m
        level = RING_SIGMAS * SIGMA_PER_WIDTH * (widths[0] / at_m + widths[2])
        upward = RING_SIGMAS * SIGMA_PER_WIDTH * (widths[1] / at_m + widths[3])
        axes = (dx, dy, dz), (lx, ly, lz)
        first = index[n] % (RING // 2)
        both_m, missing = 0.0, 1 if math.isnan(middle_m[n]) else 0
        for place in range(2):
            x, y, z = _ring_ray(axes, level, upward, first + TURNS[place])
            t, _, _ = first_hit(tables, ox, oy, oz, x, y, z, limit_m, thin_m)
            both_m, missing = both_m + t, missing + (1 if math.isnan(t) else 0)
        if not (abs(both_m - 2.0 * middle_m[n]) > EDGE_M or 0 < missing < 3):
            continue
        for place in range(RING):
            x, y, z = _ring_ray(axes, level, upward, first + TURNS[place])
            t, what, which = first_hit(tables, ox, oy, oz, x, y, z, limit_m, thin_m)
            kind, cosine, hit = surface_hit(tables, what, which, t, ox, oy, oz, x, y, z)
            out_range[count, 1 + place], out_kind[count, 1 + place] = t, kind
            out_cosine[count, 1 + place], out_hit[count, 1 + place] = cosine, hit
        out_at[count] = n
        count += 1
    return count
