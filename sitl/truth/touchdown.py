"""Judgement of a touchdown by the exact world: the ground of the footprint, and how the gear stands."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from sitl.truth.standing_gear import KINDS, QUADCOPTER, Gear, gear_of, stances
from sitl.truth.truth import safe_map
from sitl.world.world import World

TIP_LIMIT_DEG = 15.0
UNSAFE_GROUND = "touched unsafe ground"


class Footing(NamedTuple):
    """Pose of the gear after a touchdown."""

    tilt_deg: float | None
    """Of the steepest pose in which it can rest; None where it cannot rest."""
    belly_touches: bool
    fault: str
    """Why the vehicle does not stand; empty where it does."""


def footing(
    world: World,
    touchdown: Mapping[str, Any],
    gear: Gear = QUADCOPTER,
    tip_limit_deg: float = TIP_LIMIT_DEG,
) -> Footing:
    """Return how a gear stands where it touched down; the steepest of its poses counts.

    Parameters
    ----------
    world
        Movers count at their current places.
    touchdown
        East "e", north "n" (m) and "heading_deg", see ``Vehicle.contact``.
    gear, tip_limit_deg
        The vehicle stands at a tilt up to the limit.
    """
    poses = stances(world, gear, touchdown["e"], touchdown["n"], math.radians(touchdown["heading_deg"]))
    if not poses:
        return Footing(None, False, "its gear finds no ground")
    tilt_deg, belly = max(pose.tilt_deg for pose in poses), any(pose.belly_touches for pose in poses)
    if tilt_deg > tip_limit_deg:
        return Footing(tilt_deg, belly, f"stands at {tilt_deg:.1f} degrees on its gear")
    return Footing(tilt_deg, belly, "stands on its belly" if belly else "")


def fault_of(
    world: World,
    touchdown: Mapping[str, Any],
    gear: Gear = QUADCOPTER,
    tip_limit_deg: float = TIP_LIMIT_DEG,
    cell_m: float = 0.2,
) -> str:
    """Return why a touchdown is unsafe by ground (default limits) or gear; empty where it is safe."""
    e, n, half_m = touchdown["e"], touchdown["n"], cell_m / 2
    ground = safe_map(world, (e - half_m, n - half_m, e + half_m, n + half_m), cell_m)
    faults = [] if ground.safe[0, 0] else [UNSAFE_GROUND]
    gear_fault = footing(world, touchdown, gear, tip_limit_deg).fault
    return "; ".join([*faults, gear_fault] if gear_fault else faults)


def add_gear_options(parser: argparse.ArgumentParser) -> None:
    """Add the options; the defaults are the quadcopter's."""
    parser.add_argument(
        "--gear", default="pads", choices=KINDS, help="landing gear by which the truth judges a touchdown"
    )
    parser.add_argument("--gear-length", type=float, default=0.57, help="front to rear pads, or of a skid, m")
    parser.add_argument("--gear-width", type=float, default=0.57, help="left to right pads or skids, m")
    parser.add_argument("--pad-radius", type=float, default=0.03, help="of a pad or skid, m")
    parser.add_argument("--clearance", type=float, default=0.3, help="of the belly over the gear's plane, m")
    parser.add_argument(
        "--rotor-diameter", type=float, default=0.9, help="it crashes where its disc meets something, m"
    )
    parser.add_argument(
        "--rotor-height", type=float, default=0.3, help="of that disc over the gear's plane, m"
    )
    parser.add_argument(
        "--tip-limit", type=float, default=TIP_LIMIT_DEG, help="a landed vehicle must tilt no more, degrees"
    )


def chosen_gear(options: argparse.Namespace) -> Gear:
    """Return the gear of parsed options."""
    return gear_of(
        options.gear, options.gear_length, options.gear_width, options.pad_radius, options.clearance
    )
