"""Base class of faults."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sitl.simulation import Simulation


class Fault:
    """Fault that begins and ends once in a flight; `step` is called after each tick between the two."""

    def begin(self, simulation: Simulation) -> None:
        """Start the fault."""

    def step(self, simulation: Simulation) -> None:
        """Continue the fault for one tick."""

    def end(self, simulation: Simulation) -> None:
        """Undo what can be undone; a moved estimate stays moved."""
