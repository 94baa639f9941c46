"""Ordered checks of a phase: the first one that returns commands decides the step."""

from __future__ import annotations

from collections.abc import Callable

from companion.flight.landing.situation import Situation, VehicleCommands

Check = Callable[[Situation], VehicleCommands | None]  # None: the next check decides


def first_commands(checks: tuple[Check, ...], s: Situation) -> VehicleCommands | None:
    """Return the commands of the first check that has some, None without any; later checks do not run."""
    return next((commands for check in checks if (commands := check(s)) is not None), None)


def decided(checks: tuple[Check, ...], s: Situation) -> VehicleCommands:
    """Return the commands of the first check that has some; no commands without any."""
    return first_commands(checks, s) or VehicleCommands()
