"""How does my own method do in the benchmark? Here: heights under a footprint must lie within a limit.

slz benchmark --method-file docs/examples/own_method.py --method slz --only rock --out out/mine
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from companion.desk.open_benchmark.landing_task import (
    SAFE,
    UNKNOWN,
    UNSAFE,
    FlownReturns,
    LandingTask,
    SafeMap,
)


@dataclass(frozen=True)
class HeightRange:
    name: str = "height range"
    source: str = "docs/examples/own_method.py"

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        x, y, z = returns.points_m.T  # metres: east, north, up
        row, col, inside = task.grid.index(x, y)  # row 0 is the southernmost
        low, high = np.full(task.grid.shape, np.inf), np.full(task.grid.shape, -np.inf)
        np.minimum.at(low, (row[inside], col[inside]), z[inside])
        np.maximum.at(high, (row[inside], col[inside]), z[inside])
        size = 2 * round(task.footprint_m / 2 / task.grid.cell_m) + 1
        span = maximum_filter(high, size) - minimum_filter(low, size)
        across = task.footprint_m * np.tan(np.radians(task.slope_limit_deg))
        safe = np.where(span <= task.relief_limit_m + across, SAFE, UNSAFE)
        return SafeMap(np.where(np.isfinite(span), safe, UNKNOWN).astype(np.uint8))


METHOD = HeightRange()
