"""Start of a fault at a height in the descent."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sitl.faults.fault import Fault

if TYPE_CHECKING:
    from sitl.simulation import Simulation

ABOVE_M = 0.5
SINKING_MS = 0.1


class BelowHeight:
    """Hook of `Simulation.every_tick` that starts a fault when the vehicle sinks below a height, for good.

    The vehicle must have been half a metre above it before. The height is true, above the ground below.
    """

    def __init__(self, fault: Fault, height_m: float) -> None:
        self.fault, self.height_m = fault, height_m
        self.has_begun = False
        self._was_above = False

    def __call__(self, simulation: Simulation) -> None:
        if not self.has_begun:
            self._look(simulation)
        else:
            self.fault.on_tick(simulation)

    def _look(self, simulation: Simulation) -> None:
        truth = simulation.vehicle.truth
        east, north, up = (float(v) for v in truth.pos_enu_m)
        over_m = up - simulation.scene.world.height_below_m(east, north, up)
        self._was_above = self._was_above or over_m > self.height_m + ABOVE_M
        if self._was_above and over_m < self.height_m and truth.vel_enu_ms[2] < -SINKING_MS:
            self.has_begun = True
            self.fault.start(simulation)
