"""Second opinions on the simulator: independent ray casters, real recordings, ArduCopter's physics.

python -m tests.opinion ray [--scene NAME ...]    # needs embreex and mujoco, which the project does not
python -m tests.opinion noise                     # needs the recordings, found by SLZ_DATA
python -m tests.opinion fly URL FILE.json         # one flight of ArduCopter SITL, or of `python -m sitl`
python -m tests.opinion vehicle FILE.json ...     # measures of these flights
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sitl import scenes
from tests.opinion import flight_measures
from tests.opinion.scripted_flight import Flight


def main() -> int:
    """Run one comparison; 1 if it found a difference without a known cause."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.opinion", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    ray = commands.add_parser("ray", help="rays of the simulated LiDARs against Embree and MuJoCo")
    ray.add_argument("--scene", nargs="+", choices=scenes.NAMES, default=list(scenes.NAMES))
    ray.add_argument("--seed", type=int, default=1)
    commands.add_parser("noise", help="noise of the simulated LiDARs against recordings")
    fly = commands.add_parser("fly", help="fly one script and record it")
    fly.add_argument("url")
    fly.add_argument("record", type=Path)
    vehicle = commands.add_parser("vehicle", help="compare recorded flights")
    vehicle.add_argument("records", nargs="+", type=Path)
    own = parser.parse_args()
    if own.command == "ray":
        from tests.opinion import ray as comparison

        return comparison.run(own.scene, own.seed)
    if own.command == "noise":
        from tests.opinion import noise

        return noise.run()
    if own.command == "fly":
        Flight(own.url).record(own.record)
        return 0
    return flight_measures.run(own.records)


if __name__ == "__main__":
    sys.exit(main())
