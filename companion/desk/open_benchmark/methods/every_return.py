"""Reference that is no method: every cell near a return is called safe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.desk.open_benchmark.landing_task import SAFE, UNKNOWN, FlownReturns, LandingTask, SafeMap
from companion.desk.open_benchmark.methods.elevation_grid import cell_statistics, fill_gaps


@dataclass(frozen=True, slots=True)
class EveryReturn:
    """Share of unsafe ground that nobody looks at: what any method must beat."""

    name: str = "all seen ground"
    source: str = "none: reference that calls every cell within 0.5 m of a return safe"
    reach_m: float = 0.5

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        seen = fill_gaps(cell_statistics(returns, task.grid).mean_m, self.reach_m / task.grid.cell_m)
        return SafeMap(np.where(np.isfinite(seen), SAFE, UNKNOWN).astype(np.uint8))


METHOD = EveryReturn()
