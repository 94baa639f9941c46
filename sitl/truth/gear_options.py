"""Options of the landing gear on the simulator's command line."""

from __future__ import annotations

import argparse

from sitl.truth.standing_gear import KINDS, Gear, gear_of
from sitl.truth.touchdown import TIP_LIMIT_DEG


def add_options(parser: argparse.ArgumentParser) -> None:
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


def chosen(options: argparse.Namespace) -> Gear:
    """Return the gear of parsed options."""
    return gear_of(
        options.gear, options.gear_length, options.gear_width, options.pad_radius, options.clearance
    )
