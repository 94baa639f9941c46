"""What every fault is."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sitl.simulation import Simulation


class Fault:
    """Begins and ends once in a flight; `step` is called after each tick between the two."""

    def begin(self, simulation: Simulation) -> None:
        """Let it go wrong from now on."""

    def step(self, simulation: Simulation) -> None:
        """Go on."""

    def end(self, simulation: Simulation) -> None:
        """Heal what can heal; a moved estimate stays moved."""
