"""Dark returns: deep or murky water that answers obliquely is darker than any dry ground.

Water absorbs near infrared light: at 905 nm a path of 0.2 m leaves a quarter of it (Kou et al., 1993), and
little is scattered back. Fresh tarmac sends back 4 to 5 %, soaked soil as much. Only sensors whose intensity
is calibrated tell this.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import DARK
from slz.surface.surface_cells import Floats, SurfaceCells

FEWEST = 6.0  # dark returns more than others, of the neighbourhood
AROUND = 1  # cells
SCORE = 3.5  # log odds


def dark_returns(cells: SurfaceCells) -> Floats:
    """Return the log odds for water of every cell from how dark it is; 0 where it is not."""
    dark = cells.fields[DARK]
    if not (dark > 0).any():
        return np.zeros(cells.shape, np.float32)
    around = box_sums(dark[np.newaxis].copy(), AROUND)[0]
    return np.where((around >= FEWEST) & (dark >= 0), np.float32(SCORE), np.float32(0))
