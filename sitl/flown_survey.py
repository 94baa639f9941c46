"""A flown survey as a cloud: what the LiDAR would measure along parallel lines, placed with the true pose.

It evaluates the mapping alone, without the errors of a navigation filter. The vehicle keeps its height
above the highest object within its swath, like a terrain follower. With `--surface` the file also holds
evidence of the kind of ground besides its shape: brightness of returns, rays without a return, and its truth.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl import scenes
from sitl.scenes import Scene
from sitl.sensors import lidars
from sitl.sensors.mid360 import Mid360
from sitl.sensors.pulse_lidar import PulseLidar, Shots
from sitl.truth.surface_class import SurfaceClass, surface_map
from sitl.truth.truth import safe_map

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

SWATH_M = 15.0
SMOOTHING_M = 20.0
CHUNK_NS = 100_000_000
LOST_M = 100.0
LEAST_DEPRESSION_DEG = 5.0
"""Of a ray without a return below the horizon; others are left out, as they meet no ground."""
THINNING = 11
"""Rays without a return, one of which a driver of the Mid-360 passes on."""


@dataclass(frozen=True, slots=True)
class Lines:
    """Parallel survey lines, flown one after the other from west to east and back.

    height_m: above the highest object below. spacing_m: between lines. extent_m: x_min, y_min, x_max, y_max.
    climb_m: gained steadily from the start of the first line to the end of the last.
    """

    extent_m: tuple[float, float, float, float]
    height_m: float = 20.0
    spacing_m: float = 15.0
    speed_ms: float = 5.0
    climb_m: float = 0.0


class Track:
    """Trajectory along the lines, level, the nose along the line."""

    def __init__(self, scene: Scene, lines: Lines) -> None:
        x0, y0, x1, y1 = lines.extent_m
        count = max(1, int(np.ceil((y1 - y0) / lines.spacing_m)))
        rows = y0 + (np.arange(count) + 0.5) * (y1 - y0) / count
        ends = [((x0, y), (x1, y)) if i % 2 == 0 else ((x1, y), (x0, y)) for i, y in enumerate(rows)]
        self._corners = np.array([corner for line in ends for corner in line])
        steps = np.hypot(*np.diff(self._corners, axis=0).T)
        self._along = np.concatenate([[0.0], np.cumsum(steps)])
        self._speed = lines.speed_ms
        self.duration_s = float(self._along[-1]) / lines.speed_ms
        places = np.arange(0.0, self._along[-1] + 1.0, 1.0)
        climb = lines.climb_m * places / max(1.0, float(places[-1]))
        self._places, self._heights = places, self._clear(scene, places) + lines.height_m + climb

    def _clear(self, scene: Scene, places: F64) -> F64:
        """Return the highest surface within the swath, smoothed so that the vehicle can follow it."""
        x, y = self._position(places)
        offset = np.arange(-SWATH_M, SWATH_M + 1.0, 1.0)
        dx, dy = np.meshgrid(offset, offset)
        z, _ = scene.world.surface(x[:, None] + dx.ravel(), y[:, None] + dy.ravel())
        z = np.where(np.isnan(z), -np.inf, z).max(axis=1)
        z[np.isinf(z)] = z[np.isfinite(z)].min()
        reach = int(SMOOTHING_M)
        padded = np.pad(z, 2 * reach, mode="edge")
        highest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
        smooth = np.convolve(highest, np.full(2 * reach + 1, 1 / (2 * reach + 1)), mode="valid")
        out: F64 = smooth[: len(places)]
        return out

    def _position(self, along_m: F64) -> tuple[F64, F64]:
        x = np.interp(along_m, self._along, self._corners[:, 0])
        y = np.interp(along_m, self._along, self._corners[:, 1])
        return x, y

    def at(self, stamps_ns: I64) -> tuple[F64, F64]:
        """Return positions ENU (n, 3) and quaternions (n, 4) body FRD to NED."""
        along: F64 = stamps_ns.astype(np.float64) * 1e-9 * self._speed
        x, y = self._position(along)
        ahead, _ = self._position(along + 0.5)
        behind, _ = self._position(along - 0.5)
        heading = np.where(ahead >= behind, np.pi / 2, -np.pi / 2)
        zero = np.zeros_like(x)
        quat = np.column_stack([np.cos(heading / 2), zero, zero, np.sin(heading / 2)])
        return np.column_stack([x, y, np.interp(along, self._places, self._heights)]), quat


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """Returns of a tenth of a second, and rays without a return, placed with the true pose.

    points_enu_m: (n, 3). stamp_ns: (n,). sensor_enu_m: (3,), at the last stamp. bright: (n,) share of what a
    white target sends back. lost_enu_m, lost_origin_enu_m: (m, 3), point at `LOST_M` along every `THINNING`th
    ray without a return, as far as it points below the horizon, and the sensor's position then.
    """

    points_enu_m: F64
    stamp_ns: I64
    sensor_enu_m: F64
    bright: F32
    lost_enu_m: F32
    lost_origin_enu_m: F32


def fly(
    scene: Scene, lines: Lines, seed: int, point_rate_hz: int = 200_000, lidar_name: str = "mid360"
) -> Iterator[PlacedScan]:
    """Yield a scan per tenth of a second.

    Returns that the sensor marks as rain, dust or echo are dropped, as in a driver.

    Raises
    ------
    ValueError
        There is no such LiDAR among `lidars.PULSED`, or it cannot fire at that rate.
    """
    lidar = lidars.build_pulsed(lidar_name, np.random.default_rng(seed), point_rate_hz)
    track = Track(scene, lines)
    n_lost = 0
    for start in range(0, int(track.duration_s * 1e9), CHUNK_NS):
        shots = lidar.shots(start, start + CHUNK_NS, track.at, scene.world)
        good = shots.echoes.range_m != 0
        if isinstance(lidar, Mid360):
            good &= lidar.tags(shots) == 0
        points, stamps = lidar.points_m(shots)[good], lidar.stamps_ns(shots)[good]
        position, attitude = track.at(stamps)
        sensor = position + lidar.mount.lever_enu_m(attitude)
        last = sensor[-1] if len(sensor) else track.at(np.array([start]))[0][0]
        traced = lidar.is_traced(shots.index)
        lost = np.flatnonzero((shots.echoes.range_m == 0) & (True if traced is None else traced))
        ends, origins = _lost_rays(lidar, track, shots, lost[-n_lost % THINNING :: THINNING])
        n_lost += len(lost)
        yield PlacedScan(
            sensor + lidar.mount.to_enu(points, attitude),
            stamps,
            last,
            shots.bright[good].astype(np.float32),
            ends,
            origins,
        )


def _lost_rays(lidar: PulseLidar, track: Track, shots: Shots, which: I64) -> tuple[F32, F32]:
    """Return ends and origins, (m, 3) each, of those pulses of a selection that point below the horizon."""
    position, attitude = track.at(lidar.stamps_ns(shots)[which])
    way = lidar.mount.to_enu(shots.unit[which], attitude)
    down = way[:, 2] <= -np.sin(np.radians(LEAST_DEPRESSION_DEG))
    origin = (position + lidar.mount.lever_enu_m(attitude))[down]
    return (origin + LOST_M * way[down]).astype(np.float32), origin.astype(np.float32)


def main(arguments: list[str] | None = None) -> int:
    """Fly lines over a scene and write the cloud and the truth below it into one file."""
    parser = argparse.ArgumentParser(
        prog="python -m sitl.flown_survey", description=str(__doc__).splitlines()[0]
    )
    parser.add_argument("--scene", default="stadium", help=", ".join(scenes.NAMES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--extent", metavar="X0,Y0,X1,Y1", help="metres; default: the scene's own")
    parser.add_argument("--height", type=float, default=20.0, help="m above the highest thing below")
    parser.add_argument("--spacing", type=float, default=15.0, help="m between lines")
    parser.add_argument("--speed", type=float, default=5.0, help="m/s")
    parser.add_argument("--climb", type=float, default=0.0, help="m gained over all lines")
    parser.add_argument("--point-rate", type=int, default=200_000)
    parser.add_argument("--cell", type=float, default=0.2, help="cell of the truth, m")
    parser.add_argument("--footprint", type=float, default=2.0, help="footprint of the truth, m")
    parser.add_argument("--slope-limit", type=float, default=10.0, help="degrees")
    parser.add_argument("--relief-limit", type=float, default=0.3, help="m")
    parser.add_argument(
        "--surface", action="store_true", help="also brightness, lost rays and the true kind of ground"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.npz")
    options = parser.parse_args(arguments)
    try:
        scene = scenes.build(options.scene, options.seed)
        extent = extent_of(options.extent, scene)
        lines = Lines(extent, options.height, options.spacing, options.speed, options.climb)
        scans = list(fly(scene, lines, options.seed, options.point_rate))
    except ValueError as error:
        parser.error(str(error))
    truth = safe_map(
        scene.world,
        extent,
        options.cell,
        options.footprint,
        options.slope_limit,
        options.relief_limit,
    )
    np.savez(
        options.out,
        points_enu_m=np.concatenate([scan.points_enu_m for scan in scans]).astype(np.float32),
        stamp_ns=np.concatenate([scan.stamp_ns for scan in scans]),
        sensor_enu_m=np.array([scan.sensor_enu_m for scan in scans]),
        count=np.array([len(scan.stamp_ns) for scan in scans]),
        extent_m=np.array(extent),
        cell_m=options.cell,
        safe=truth.safe,
        height_m=truth.height_m,
        slope_deg=truth.slope_deg,
        relief_m=truth.relief_m,
        regions=json.dumps({name: list(corners) for name, corners in scene.regions.items()}),
        description=scene.description,
        **(_surface(scene, extent, options.cell, scans) if options.surface else {}),
    )
    return 0


def _surface(
    scene: Scene, extent: tuple[float, float, float, float], cell_m: float, scans: list[PlacedScan]
) -> dict[str, Any]:
    """Return the arrays of `--surface`; `surface` holds numbers of `surface_names`, in cells of the truth."""
    truth = surface_map(scene.world, extent, cell_m)
    lost = np.concatenate([scan.lost_enu_m for scan in scans])
    return {
        "bright": np.concatenate([scan.bright for scan in scans]),
        "lost_enu_m": lost,
        "lost_origin_enu_m": np.concatenate([scan.lost_origin_enu_m for scan in scans]),
        "lost_weight": np.full(len(lost), THINNING, np.float32),
        "lost_count": np.array([len(scan.lost_enu_m) for scan in scans]),
        "surface": truth.surface,
        "surface_names": json.dumps({kind.name: kind.value for kind in SurfaceClass}),
        "roof_height_m": truth.roof_height_m,
    }


def extent_of(text: str | None, scene: Scene) -> tuple[float, float, float, float]:
    """Return the extent that `--extent` names, by default the scene's own; ValueError if it is not in it."""
    if text is None:
        return scene.extent_m
    try:
        x0, y0, x1, y1 = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"--extent {text!r}: write X0,Y0,X1,Y1") from None
    low = scene.extent_m
    if not (low[0] <= x0 < x1 <= low[2] and low[1] <= y0 < y1 <= low[3]):
        raise ValueError(f"--extent {text!r} must lie within {low}")
    return x0, y0, x1, y1


if __name__ == "__main__":
    sys.exit(main())
