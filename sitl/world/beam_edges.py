"""Beams that an edge divides: part of one meets the near surface, the rest what is behind.

A beam is Gaussian, taken as one ray in its middle and `RING` rays around it, weighted so that the variance is
that of the beam. Two opposite rays of the ring look for an edge first: on a plane, however oblique, the sum
of their ranges is twice that of the middle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.array_types import Array1D, Array2D
from sitl.compilation import kernel
from sitl.world.primitives import REFLECTANCE
from sitl.world.wires import Beam
from sitl.world.world import Crossings

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Flags = NDArray[np.bool_]

RING = 6
MIDDLE_SHARE = 0.25
RING_SHARE = (1.0 - MIDDLE_SHARE) / RING
RING_SIGMAS = float(np.sqrt(2.0 / (1.0 - MIDDLE_SHARE)))
"""Radius of the ring in standard deviations of the beam."""
SIGMA_PER_WIDTH = float(1.0 / np.sqrt(8.0 * np.log(2.0)))
EDGE_M = 0.05
"""Departure from a plane that counts as an edge."""

Cast = Callable[[I64, F64], Crossings]
"""Cast rays from the origins of some beams (n,), in directions (n, 3)."""


@dataclass(frozen=True, slots=True)
class EdgeEchoes:
    """Echoes of beams that an edge divides.

    divided: (n,) mask of all beams. range_m, bright: (k, 1 + `RING`) of those, range NaN for none. hit: codes
    of ``hits``.
    """

    divided: Flags
    range_m: F64
    bright: F64
    hit: I64


def edge_echoes(
    middle: Crossings, index: I64, directions: F64, ups: F64, beam: Beam, limit_m: float, cast: Cast
) -> EdgeEchoes:
    """Return the echoes of the beams with an edge inside.

    Parameters
    ----------
    middle
        What the rays in the middle meet.
    index
        (n,) number of each pulse; the pair of rays that looks for an edge follows from it.
    directions, ups
        (n, 3) unit directions, and the sensor's up, ENU.
    beam
        Widths of the beam.
    limit_m
        Range at which the width of a beam counts that meets nothing in the middle.
    cast
        Casts more rays.
    """
    n, half = len(directions), RING // 2
    widths = np.array([*beam.exit_m, *beam.divergence_rad])
    rays = _Rays(directions, ups, middle.range_m, index)
    pair = cast(np.tile(np.arange(n), 2), rays.ring((0, half), widths, limit_m))
    divided = _is_edge(middle.range_m, pair.range_m[:n], pair.range_m[n:])
    k = np.flatnonzero(divided)
    some = _Rays(directions[k], ups[k], middle.range_m[k], index[k])
    others = [turn for turn in range(RING) if turn % half]
    rest = cast(np.tile(k, len(others)), some.ring(others, widths, limit_m))
    every = np.arange(k.size)
    parts = [middle.of(k), pair.of(k), pair.of(n + k)]
    parts += [rest.of(every + place * k.size) for place in range(len(others))]
    shares = np.array([MIDDLE_SHARE, *[RING_SHARE] * RING])
    bright = np.column_stack([REFLECTANCE[part.kind] * part.cosine for part in parts])
    return EdgeEchoes(
        divided,
        np.column_stack([part.range_m for part in parts]),
        shares * bright,
        np.column_stack([part.hit for part in parts]),
    )


@dataclass(frozen=True, slots=True)
class _Rays:
    """Rays in the middle of beams; see `edge_echoes`."""

    directions: F64
    ups: F64
    range_m: F64
    index: I64

    def ring(self, turns: Sequence[int], widths: F64, limit_m: float) -> F64:
        """Return the rays some places round the ring from the one that looks for an edge, turn by turn."""
        out = np.empty((len(turns), len(self.index), 3))
        directions, ups = np.ascontiguousarray(self.directions), np.ascontiguousarray(self.ups)
        for place, turn in enumerate(turns):
            ring_directions(directions, ups, self.range_m, self.index, turn, widths, limit_m, out[place])
        return out.reshape(-1, 3)


@kernel
def ring_directions(
    directions: Array2D[np.float64],
    ups: Array2D[np.float64],
    range_m: Array1D[np.float64],
    index: Array1D[np.int64],
    turn: int,
    widths: Array1D[np.float64],
    limit_m: float,
    out: Array2D[np.float64],
) -> None:
    """Write unit directions of rays of the ring.

    `widths` are those of ``Beam``: level and upward at the exit, then per range.
    """
    for n in range(directions.shape[0]):
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        lx = dy * ups[n, 2] - dz * ups[n, 1]
        ly = dz * ups[n, 0] - dx * ups[n, 2]
        lz = dx * ups[n, 1] - dy * ups[n, 0]
        length = max(math.sqrt(lx * lx + ly * ly + lz * lz), 1e-9)
        lx, ly, lz = lx / length, ly / length, lz / length
        at_m = max(range_m[n], 0.1) if math.isfinite(range_m[n]) else limit_m
        angle = 2.0 * math.pi / RING * (index[n] % (RING // 2) + turn)
        aside = RING_SIGMAS * SIGMA_PER_WIDTH * (widths[0] / at_m + widths[2]) * math.cos(angle)
        up = RING_SIGMAS * SIGMA_PER_WIDTH * (widths[1] / at_m + widths[3]) * math.sin(angle)
        x = dx + aside * lx + up * (ly * dz - lz * dy)
        y = dy + aside * ly + up * (lz * dx - lx * dz)
        z = dz + aside * lz + up * (lx * dy - ly * dx)
        length = math.sqrt(x * x + y * y + z * z)
        out[n, 0], out[n, 1], out[n, 2] = x / length, y / length, z / length


def _is_edge(middle_m: F64, one_m: F64, other_m: F64) -> Flags:
    with np.errstate(invalid="ignore"):
        bent = np.abs(one_m + other_m - 2.0 * middle_m) > EDGE_M
    missing = np.isnan(middle_m).astype(np.int64) + np.isnan(one_m) + np.isnan(other_m)
    return np.asarray(bent | ((missing > 0) & (missing < 3)))
