"""Second opinions on the simulator: independent ray casters, real recordings, and another autopilot's physics.

python -m tests.opinion ray [--scene NAME ...]     # needs embreex and mujoco, which the project does not
"""

from __future__ import annotations

import argparse
import sys

from sitl import scenes


def main() -> int:
    """Run one comparison; 1 if it found a difference without a known cause."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.opinion", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    ray = commands.add_parser("ray", help="rays of the simulated LiDARs against Embree and MuJoCo")
    ray.add_argument("--scene", nargs="+", choices=scenes.NAMES, default=list(scenes.NAMES))
    ray.add_argument("--seed", type=int, default=1)
    own = parser.parse_args()
    if own.command == "ray":
        from tests.opinion import ray as comparison

        return comparison.run(own.scene, own.seed)
    return 2


if __name__ == "__main__":
    sys.exit(main())
