"""Base class of faults."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sitl.simulation import Simulation


class Fault:
    """Fault that starts and stops once in a flight; `on_tick` is called after each tick between the two."""

    def start(self, simulation: Simulation) -> None:
        """Start the fault."""

    def on_tick(self, simulation: Simulation) -> None:
        """Continue the fault for one tick."""

    def stop(self, simulation: Simulation) -> None:
        """Undo what can be undone; a moved estimate stays moved."""
