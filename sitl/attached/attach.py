"""Command `python -m sitl --autopilot URL`: the LiDAR alone, on the vehicle of a running autopilot."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from sitl import scenes
from sitl.attached.attached_lidar import AttachedLidar
from sitl.attached.client_wire import open_client
from sitl.attached.pose_source import Place
from sitl.sensors.lidar_port import Address
from sitl.signals import Signals
from sitl.truth import gear_options, truth

IDLE_S = 0.002
# Options of the whole vehicle; the followed autopilot has its own.
FOREIGN = (
    "airframe",
    *("mavlink", "mavlink_key", "lockstep", "speedup", "pilot", "takeoff_alt", "intruder"),
    *("fault", "drift", "param", "imu_to", "wind", "wind_from", "gust"),
)
FLAT_ENOUGH = 0.98


def refuse_foreign(options: argparse.Namespace, defaults: Callable[[str], object]) -> None:
    """Raise ValueError if an option is given that is meaningless with --autopilot."""
    for name in FOREIGN:
        if getattr(options, name) != defaults(name):
            raise ValueError(
                f"--{name.replace('_', '-')} means nothing with --autopilot, which has a vehicle"
            )


def build(options: argparse.Namespace, origin: Place | None, lidar_to: Address | None) -> AttachedLidar:
    """Open the wire and build the scene; raise WireError or ValueError with one line for the user."""
    wire = open_client(options.autopilot)
    try:
        attached = AttachedLidar(
            scenes.build(options.scene, options.seed),
            wire,
            seed=options.seed,
            lidar="mid360" if options.lidar == "none" else options.lidar,
            lidar_to=lidar_to,
            point_rate_hz=round(options.point_rate),
            lidar_dual=options.dual,
            origin_lla=origin,
            say=_say,
        )
    except ValueError:
        wire.close()
        raise
    attached.log.gear, attached.log.tip_limit_deg = gear_options.chosen(options), options.tip_limit
    return attached


def follow(attached: AttachedLidar, options: argparse.Namespace, signals: Signals) -> int:
    """Run until a signal arrives or the duration is over; return the exit code."""
    _say(f"waiting for an autopilot at {attached.wire.name}")
    begun_s = time.monotonic()
    announced = False
    try:
        with signals.awaited():
            while not signals.came:
                now_s = time.monotonic()
                if options.duration is not None and now_s - begun_s >= options.duration:
                    break
                if not attached.advance(now_s):
                    time.sleep(IDLE_S)
                if attached.ready and not announced:
                    announced = True
                    _announce(attached, options)
    finally:
        attached.close()
    return _write(attached, options)


def _announce(attached: AttachedLidar, options: argparse.Namespace) -> None:
    flat = attached.flat_share()
    if flat < FLAT_ENOUGH:
        _say(
            f"{100 * (1 - flat):.0f} % of the scene is not level with home; the autopilot's ground is, so "
            "that a landing there ends above or below what the LiDAR shows"
        )
    line = {
        "ready": True,
        "autopilot": attached.source.kind,
        "pose": attached.source.source,
        "mavlink": [attached.wire.name],
        "lidar": None if attached.lidar is None else attached.lidar.name,
        "origin": attached.origin_lla,
        "level_share": round(flat, 3),
    }
    print(json.dumps(line), flush=True)


def _write(attached: AttachedLidar, options: argparse.Namespace) -> int:
    if options.truth is None:
        return 0
    folder: Path = options.truth
    if attached.origin_lla is None:
        _say(f"--truth {folder}: nothing is written, for no autopilot said where it is")
        return 1
    _say(f"writing {folder}; a signal ends it without")
    try:
        attached.log.write(folder, attached.origin_lla)
        truth.write(
            folder,
            attached.scene,
            attached.origin_lla,
            footprint_m=options.footprint,
            slope_limit_deg=options.slope_limit,
            relief_limit_m=options.relief_limit,
        )
    except OSError as error:
        _say(f"--truth {folder}: {error.strerror or error}")
        return 1
    return 0


def _say(line: str) -> None:
    print(f"slz sim: {line}", file=sys.stderr, flush=True)
