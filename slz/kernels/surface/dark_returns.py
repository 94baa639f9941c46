"""Dark returns: deep or murky water that answers obliquely is darker than any dry ground.

Water absorbs near infrared light: at 905 nm a path of 0.2 m leaves a quarter of it (Kou et al., 1993), and
little is scattered back. Fresh tarmac sends back 4 to 5 %, soaked soil as much. Only sensors whose intensity
is calibrated tell this.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.jit import kernel
from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.piecewise_linear import F0
from slz.kernels.surface.surface_record import DARK

FEWEST = 6.0  # dark returns more than others, of the neighbourhood
AROUND = 1  # cells
EXTENT, FEWEST_ON_EXTENT = 10, 60.0  # cells around, and dark returns there on the same level extent
SCORE = np.float32(3.5)  # log odds


@kernel
def dark_returns(fields: Array3D[np.float32], level: Array2D[np.bool_]) -> Array2D[np.float32]:
    """Return the log odds for water of every cell from how dark it is; 0 where it is not.

    A cell seen from above alone shows a mirror, and is as dark as the level extent around it.

    Parameters
    ----------
    level
        (rows, cols), cells of level extents.
    """
    dark, on_level = fields[DARK : DARK + 1], np.zeros_like(fields[:1])
    out: Array2D[np.float32] = np.zeros_like(fields[0])
    any_dark = any_silent = False
    for k in range(out.size):
        any_dark |= bool(dark.flat[k] > F0)
    if not any_dark:
        return out
    for k in range(out.size):
        if level.flat[k]:
            on_level.flat[k] = dark.flat[k]
            any_silent |= dark.flat[k] == F0
    around = box_sums(dark, AROUND)
    wide = box_sums(on_level, EXTENT) if any_silent else on_level
    for k in range(out.size):
        by_extent = any_silent and level.flat[k] and wide.flat[k] >= FEWEST_ON_EXTENT
        if dark.flat[k] >= F0 and (around.flat[k] >= FEWEST or by_extent):
            out.flat[k] = SCORE
    return out
