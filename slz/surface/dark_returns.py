"""Dark returns: deep or murky water that answers obliquely is darker than any dry ground.

Water absorbs near infrared light: at 905 nm a path of 0.2 m leaves a quarter of it (Kou et al., 1993), and
little is scattered back. Fresh tarmac sends back 4 to 5 %, soaked soil as much. Only sensors whose intensity
is calibrated tell this.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import DARK
from slz.surface.surface_cells import Flags, Floats, SurfaceCells

FEWEST = 6.0  # dark returns more than others, of the neighbourhood
AROUND = 1  # cells
EXTENT, FEWEST_ON_EXTENT = 10, 60.0  # cells around, and dark returns there on the same level extent
SCORE = 3.5  # log odds


def dark_returns(cells: SurfaceCells, level: Flags) -> Floats:
    """Return the log odds for water of every cell from how dark it is; 0 where it is not.

    A cell seen from above alone shows a mirror, and is as dark as the level extent around it.

    Parameters
    ----------
    level
        (rows, cols), cells of level extents.
    """
    dark = cells.fields[DARK]
    if not (dark > 0).any():
        return np.zeros(cells.shape, np.float32)
    around = box_sums(dark[np.newaxis].copy(), AROUND)[0]
    told = around >= FEWEST
    if (level & (dark == 0)).any():
        told |= level & (box_sums((dark * level)[np.newaxis], EXTENT)[0] >= FEWEST_ON_EXTENT)
    return np.where(told & (dark >= 0), np.float32(SCORE), np.float32(0))
