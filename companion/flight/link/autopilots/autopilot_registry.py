"""Registry of autopilots by the MAV_AUTOPILOT of their heartbeats.

A program of the user's can add its own before it calls ours (`docs/autopilot.md`).
"""

from __future__ import annotations

from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, UNKNOWN, Autopilot
from companion.flight.link.autopilots.px4 import PX4

_registered = {autopilot.mav_autopilot: autopilot for autopilot in (ARDUPILOT, PX4)}


def autopilot_of(mav_autopilot: int) -> Autopilot:
    """Return the autopilot of a heartbeat, `OTHER` if none is registered by this number."""
    return _registered.get(mav_autopilot, OTHER)


def registered_autopilots() -> tuple[Autopilot, ...]:
    """Return all autopilots, ours first."""
    return tuple(_registered.values())


def add_autopilot(autopilot: Autopilot) -> None:
    """Register an autopilot, in all of this process.

    Raises
    ------
    ValueError
        It has no `mav_autopilot`, or its number or name is in use.
    """
    number, names = autopilot.mav_autopilot, {a.name for a in (UNKNOWN, OTHER, *_registered.values())}
    if number is None or number in _registered or autopilot.name in names:
        raise ValueError(f"autopilot {autopilot.name!r}, MAV_AUTOPILOT {number}: no number, or there already")
    _registered[number] = autopilot


def remove_autopilot(autopilot: Autopilot) -> None:
    """Undo `add_autopilot`; raise KeyError for one that was not added."""
    del _registered[autopilot.mav_autopilot]
