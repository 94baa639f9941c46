"""Approaches to a wire with the simulator's sensors: how far away it is when it is found.

python -m tests.bench.wires --approaches 20 --way level --thickness-mm 10
python -m tests.bench.wires --approaches 20 --way down --sensor vlp16 --out wires.json
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import params
from sitl.scenes.ground import Terrain
from sitl.scenes.power_lines import heights_m, span
from sitl.sensors.lidar_mount import Mount
from sitl.sensors.mid360 import Mid360
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.sensors.vlp16 import Vlp16
from sitl.world.world import World
from slz.air.seen_air import SeenAir
from slz.wires.wire_detector import WireDetector

Floats = NDArray[np.float64]
TOO_NEAR_M = 8.0
NEAREST_M = 6.0
HALF_M = 70.0
PLACE_NOISE_M, TURN_NOISE_RAD = 0.03, math.radians(0.1)  # of the pose, constant within a window
MOUNT_PITCH_DEG = {"mid360": {"level": 0.0, "down": 112.5}, "vlp16": {"level": 0.0, "down": 90.0}}


@dataclass(frozen=True, slots=True)
class Way:
    """Straight way from a start (3,) at a velocity (3,), with a heading (rad, clockwise from north)."""

    start_m: Floats
    velocity_ms: Floats
    heading_rad: float
    pitch_deg: float

    def pose_at(self, stamps_ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return positions (n, 3) and attitudes (n, 4) of the vehicle."""
        position = self.start_m + stamps_ns[:, np.newaxis] * 1e-9 * self.velocity_ms
        half = self.heading_rad / 2
        attitude = np.tile([math.cos(half), 0.0, 0.0, math.sin(half)], (len(stamps_ns), 1))
        return position, attitude


@dataclass(frozen=True, slots=True)
class Approach:
    """World with one wire, the wire's points (n, 3), and the way towards it."""

    world: World
    wire_m: Floats
    way: Way


def approach(number: int, way: str, sensor: str, thickness_mm: float) -> Approach:
    """Return the approach of a number: span, sag, height and crossing angle follow from it.

    Ways: level flies towards the wire, up to 3 m below it, at 5 m/s with the sensor upright; down descends
    onto it at 2 m/s with the sensor that looks down.
    """
    rng = np.random.default_rng(number)
    length_m, height_m = float(rng.uniform(30, 90)), float(rng.uniform(8, 14))
    crossing, rise_m = math.radians(float(rng.uniform(30, 150))), float(rng.uniform(-1.5, 1.5))
    sag_m = float(rng.uniform(0.01, 0.025)) * length_m
    share = float(rng.uniform(0.25, 0.75))
    along = np.array([math.cos(crossing), math.sin(crossing)])
    start, stop = -share * length_m * along, (1 - share) * length_m * along
    ends = (*start.tolist(), height_m), (*stop.tolist(), height_m + rise_m)
    terrain = Terrain(HALF_M, 0.5, rng)
    world = World(terrain.ground(), span("wire", *ends, sag_m, thickness_mm / 2000))
    s = np.linspace(0, length_m, 1000)
    up = height_m + heights_m(s, length_m, rise_m, sag_m)
    wire_m = np.column_stack([start + s[:, np.newaxis] * along, up])
    crossed_m = float(np.interp(share * length_m, s, up))
    if way == "level":
        from_m = np.array([-45.0, 0.0, crossed_m - float(rng.uniform(0.5, 3.0))])
        velocity, heading = np.array([5.0, 0.0, 0.0]), math.pi / 2
    else:
        from_m = np.array([*rng.uniform(-3, 3, 2), crossed_m + 35.0])
        velocity, heading = np.array([0.0, 0.0, -2.0]), float(rng.uniform(0, 2 * math.pi))
    return Approach(world, wire_m, Way(from_m, velocity, heading, MOUNT_PITCH_DEG[sensor][way]))


def found_at_m(task: Approach, sensor: str, rate_hz: int, window_s: float, seed: int) -> dict[str, Any]:
    """Fly an approach; return the distance to the wire when it is found, NaN where it is not."""
    rng = np.random.default_rng(seed)
    mount = Mount(pitch_deg=task.way.pitch_deg)
    lidar: PulseLidar = Mid360(rng, mount, point_rate_hz=rate_hz) if sensor == "mid360" else Vlp16(rng, mount)
    parameters = params.load("quadcopter", [])
    air = SeenAir(parameters)
    detector, step_ns = WireDetector(parameters, air), round(window_s * 1e9)
    told: dict[str, Any] = {"found_m": math.nan, "returns": 0, "windows": 0, "false": 0}
    milliseconds = []
    for k in range(200):
        stamps = np.array([k * step_ns, (k + 1) * step_ns])
        (_, here), _ = task.way.pose_at(stamps)
        away_m = float(np.linalg.norm(task.wire_m - here, axis=1).min())
        if away_m < NEAREST_M:
            break
        shots = lidar.shots(int(stamps[0]), int(stamps[1]), task.way.pose_at, task.world)
        points = _placed(lidar, shots, task.way, mount, here, rng)
        air.add(points, np.zeros(len(points), np.uint16), here[np.newaxis], 0.0)
        started = time.thread_time()
        rays = np.zeros(len(points), np.uint16), here[np.newaxis]
        detector.update(points, here, k * window_s, int(stamps[1]), rays)
        milliseconds.append((time.thread_time() - started) * 1e3)
        wires = detector.wires(0.0)
        told["false"] = max(told["false"], len(wires) - 1)
        if wires and math.isnan(told["found_m"]):
            told |= {"found_m": away_m, "returns": wires[0].n_returns, "windows": k}
    told["ms"] = float(np.median(milliseconds))
    return told | _errors(detector, task)


def _placed(
    lidar: PulseLidar, shots: Any, way: Way, mount: Mount, here: Floats, rng: np.random.Generator
) -> Floats:
    """Return the returns of shots in the map frame, with the noise of a pose."""
    hit = shots.echoes.range_m > 0
    stamps = lidar.stamps_ns(shots)[hit]
    position, attitude = way.pose_at(stamps)
    points = position + mount.lever_enu_m(attitude) + mount.to_enu(lidar.points_m(shots)[hit], attitude)
    turn = rng.normal(0, TURN_NOISE_RAD, 3)
    return np.asarray(points + np.cross(turn, points - here) + rng.normal(0, PLACE_NOISE_M, 3))


def _errors(detector: WireDetector, task: Approach) -> dict[str, float]:
    """Return the greatest errors of the height and of the place of what was seen, at the end."""
    wires = detector.wires(0.0)
    if not wires:
        return {"height_error_m": math.nan, "aside_m": math.nan}
    one = max(wires, key=lambda wire: wire.stop_m - wire.start_m)
    points, _, seen = one.sampled(0.5)
    away = np.hypot(*(points[seen, np.newaxis, :2] - task.wire_m[np.newaxis, :, :2]).transpose(2, 0, 1))
    nearest = away.argmin(axis=1)
    up = np.abs(points[seen, 2] - task.wire_m[nearest, 2])
    return {"height_error_m": float(up.max()), "aside_m": float(away.min(axis=1).max())}


def main() -> int:
    """Fly approaches and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--approaches", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--way", choices=["level", "down"], default="level")
    parser.add_argument("--sensor", choices=["mid360", "vlp16"], default="mid360")
    parser.add_argument("--thickness-mm", type=float, default=10.0)
    parser.add_argument("--rate-hz", type=int, default=200_000)
    parser.add_argument("--window-s", type=float, default=1.0)
    parser.add_argument("--out", type=Path)
    own = parser.parse_args()
    results = []
    for number in range(own.first, own.first + own.approaches):
        task = approach(number, own.way, own.sensor, own.thickness_mm)
        one = {"number": number} | found_at_m(task, own.sensor, own.rate_hz, own.window_s, number)
        results.append(one)
        print(json.dumps(one), file=sys.stderr, flush=True)
    found = np.array([one["found_m"] for one in results])
    summary = {
        "approaches": len(results),
        "found_before_8_m": float(np.mean(found > TOO_NEAR_M)),
        "found_m": [float(np.nanpercentile(found, q)) for q in (0, 10, 50, 90)],
        "false": int(sum(one["false"] for one in results)),
        "height_error_m": float(np.nanmax([one["height_error_m"] for one in results])),
        "ms_median": float(np.median([one["ms"] for one in results])),
    }
    print(json.dumps(summary))
    if own.out:
        own.out.write_text(json.dumps({"summary": summary, "approaches": results}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
