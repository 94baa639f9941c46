"""Even falls: the surface of a river falls along it, by less than 0.5 %, and is a plane over some ten metres.

So is a lake in a survey whose heights are tilted. Ground that falls so little undulates by centimetres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.surface.surface_cells import averages

BLOCK_M = 16.0  # side of the blocks in which an extent that falls is a plane
FEW = 0.2  # cells2 added to the spread of a block: one of few cells has no gradient


@dataclass(frozen=True, slots=True)
class EvenFalls:
    """Extents as planes over blocks.

    level_m: (n,) height of the plane at each cell of an extent. Of each label: inexact_m, standard deviation
    of the ground about its planes, beyond its noise; gradient, their mean.
    """

    level_m: NDArray[np.float64]
    inexact_m: NDArray[np.float64]
    gradient: NDArray[np.float64]


def even_falls(
    labels: NDArray[np.int32], height_m: NDArray[np.float64], noise_m2: NDArray[np.float64], cell_m: float
) -> EvenFalls:
    """Fit planes to the blocks of extents.

    Parameters
    ----------
    labels
        (rows, cols) of the extents, 0 for none.
    height_m
        (n,) of the cells of extents, row by row.
    noise_m2
        Of each label, the variance of such a height by noise.
    """
    place = np.argwhere(labels > 0)
    own, n = labels[labels > 0], len(noise_m2)
    block = (place // int(BLOCK_M / cell_m)) @ (1, labels.shape[1]) * n + own
    part, count = np.unique(block, return_inverse=True, return_counts=True)[1:]

    def centred(values: NDArray[np.floating]) -> NDArray[np.float64]:
        return np.asarray(values - (np.bincount(part, values) / count)[part])

    z, y, x = centred(height_m), *(centred(cell_m * along.astype(np.float64)) for along in place.T)
    xx, yy, xy, xz, yz = (np.bincount(part, sums) / count for sums in (x * x, y * y, x * y, x * z, y * z))
    xx, yy = xx + FEW * cell_m**2, yy + FEW * cell_m**2
    determinant = xx * yy - xy * xy
    a, b = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    off = z - a[part] * x - b[part] * y
    inexact_m = np.sqrt(np.maximum(0, averages(own, off**2, n) - noise_m2))
    return EvenFalls(height_m - off, inexact_m, averages(own, np.hypot(a, b)[part], n))
