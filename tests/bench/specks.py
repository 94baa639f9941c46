"""How well specks (dust, rain, snow) are told from objects, per return, and whether hazards in them are kept.

    python -m tests.bench.specks [--rates 200000 50000] [--seeds 1 2] [--only dust]

The vehicle flies 15 m at 3 m/s towards a hazard, its nose 60 degrees off its course, 8 m over level ground.
Poses are exact. Truth is which returns the simulator made of particles. Prints Markdown.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.sensors.mid360 import Mid360
from sitl.sensors.optics import Noise
from sitl.sensors.particles import AIR, Particles
from sitl.sensors.pulse_lidar import PulseLidar
from sitl.world.primitives import Box, Cylinder, Ground, Kind, Solid, Wire
from sitl.world.world import World
from slz import LocalFrame, PointAttributes, Scan
from slz.airborne.specks import REACH_M, ReturnKind, SpeckDetector

Floats = NDArray[np.float64]
FRAME = LocalFrame(47.0, 8.0, 400.0)
STEP_NS = 50_000_000
HEIGHT_M, SPEED_MS, START_M, STOP_M = 8.0, 3.0, 22.0, 7.0
OFF_COURSE = np.radians(60.0)
NEAREST_M = 0.6  # `lidar_min_m`
THINNING = 5  # lost rays, one of which is reported
CASES = {
    "even specks, 0.1 %": Noise(dust=0.001),
    "even specks, 1 %": Noise(dust=0.01),
    "even specks, 5 %": Noise(dust=0.05),
    "even specks, 20 %": Noise(dust=0.2),
    "dust in plumes, 1 %": Noise(particles=Particles(0.01, patchy=1.0)),
    "dust in plumes, 5 %": Noise(particles=Particles(0.05, patchy=1.0)),
    "dust in plumes, 20 %": Noise(particles=Particles(0.2, patchy=1.0)),
    "rain, 2 %": Noise(dropout=0.1, particles=AIR["rain"]),
    "snow, 10 %": Noise(particles=AIR["snow"]),
}
HAZARDS: dict[str, tuple[Solid, ...]] = {
    "nothing": (),
    "box 0.5 m": (Box(0, 0, HEIGHT_M - 0.25, 0.5, 0.5, 0.5),),
    "post 10 cm": (Cylinder(0, 0, 0, 0.05, HEIGHT_M + 1),),
    "person": (Box(0, 0, HEIGHT_M - 1, 0.3, 0.5, 1.75),),
    "car": (Box(0, 0, HEIGHT_M - 1, 1.8, 4.2, 1.5, kind=Kind.CAR),),
    "wire 20 mm": (Wire((0, -15, HEIGHT_M), (0, 15, HEIGHT_M), 0.01),),
    "wire 10 mm": (Wire((0, -15, HEIGHT_M), (0, 15, HEIGHT_M), 0.005),),
}


@dataclass(frozen=True)
class Seen:
    """A scan, which of its returns are of particles, and which of the hazard."""

    scan: Scan
    dust: NDArray[np.bool_]
    hazard: NDArray[np.bool_]


def world(solids: Sequence[Solid]) -> World:
    posts = np.zeros((101, 101))
    return World(Ground(-50, -50, 1.0, posts, np.full((100, 100), Kind.GRASS, np.uint8)), solids)


def pose_at(stamps_ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Fly east at a constant height and speed, and hover before the hazard."""
    east = np.minimum(-START_M + SPEED_MS * np.atleast_1d(stamps_ns) * 1e-9, -STOP_M)
    half, zero = (np.pi / 2 + OFF_COURSE) / 2, np.zeros(len(east))
    position = np.column_stack([east, zero, zero + HEIGHT_M])
    return position, np.column_stack([zero + np.cos(half), zero, zero, zero + np.sin(half)])


def flight(
    sensor: PulseLidar, place: World, solids: Sequence[Solid], duration_s: float = 6.0
) -> Iterator[Seen]:
    """Yield the scans of a flight."""
    for number in range(int(duration_s * 1e9 / STEP_NS)):
        shots = sensor.shots(number * STEP_NS, (number + 1) * STEP_NS, pose_at, place)
        stamps = sensor.stamps_ns(shots)
        position, attitude = pose_at(stamps)
        origin = position + sensor.mount.lever_enu_m(attitude)
        points = origin + sensor.mount.to_enu(sensor.points_m(shots), attitude)
        good = shots.echoes.range_m >= NEAREST_M
        lost = np.flatnonzero(shots.echoes.range_m == 0)[::THINNING]
        ends = origin[lost] + 100 * sensor.mount.to_enu(shots.unit[lost], attitude[lost])
        none = np.zeros(int(good.sum()), np.uint8)
        scan = Scan(
            points[good], stamps[good], origin[-1], FRAME,
            attributes=PointAttributes.of(shots.bright[good].astype(np.float32), none, none),
            open_enu_m=ends, open_weight=float(THINNING),
        )  # fmt: skip
        dust = shots.echoes.dust[good]
        yield Seen(scan, dust, ~dust & _on(points[good], solids))


def _on(points: Floats, solids: Sequence[Solid], margin_m: float = 0.15) -> NDArray[np.bool_]:
    """Return which points are on a solid, by its bounds."""
    on = np.zeros(len(points), bool)
    for solid in solids:
        low, high = np.reshape(solid.bounds(), (2, 3))
        on |= ((points > low - margin_m) & (points < high + margin_m)).all(axis=1)
    return on & (points[:, 2] > 0.5)


@dataclass
class Score:
    """Counts of a flight: true, false and missed specks; the hazard's returns and those called specks."""

    hit: int = 0
    false: int = 0
    missed: int = 0
    on_hazard: int = 0
    lost: int = 0
    returns: int = 0
    first_ns: int | None = None
    kept_ns: int | None = None
    gaps: int = 0  # scans with a hazard seen in the last seconds and nothing of it kept
    scans: int = 0
    seconds: float = 0.0

    @property
    def f1(self) -> float:
        return 2 * self.hit / max(1, 2 * self.hit + self.false + self.missed)


def score(noise: Noise, solids: Sequence[Solid], rate_hz: int, seed: int) -> Score:
    sensor = Mid360(np.random.default_rng(seed), point_rate_hz=rate_hz, noise=noise)
    detector, out, kept_ns = SpeckDetector(), Score(), -(10**18)
    for seen in flight(sensor, world(solids), solids):
        began = time.process_time()
        kinds = detector.classify(seen.scan)
        out.seconds += time.process_time() - began
        out.returns += len(seen.scan)
        speck = kinds == ReturnKind.SPECK
        near = np.linalg.norm(seen.scan.points_enu_m - seen.scan.sensor_enu_m, axis=1) <= REACH_M
        out.hit += int((speck & seen.dust).sum())
        out.false += int((speck & ~seen.dust).sum())
        out.missed += int((~speck & seen.dust & near).sum())
        out.on_hazard += int(seen.hazard.sum())
        out.lost += int((speck & seen.hazard).sum())
        now_ns = int(seen.scan.stamp_ns[-1])
        if seen.hazard.any() and out.first_ns is None:
            out.first_ns = now_ns
        undecided, _ = detector.seen_again
        waiting = undecided[_on(undecided, solids)]
        if (seen.hazard & ~speck).any():
            kept_ns = now_ns
            out.kept_ns = now_ns if out.kept_ns is None else out.kept_ns
        if out.first_ns is not None:
            out.scans += 1
            out.gaps += now_ns - kept_ns > 2_000_000_000 and not len(waiting)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rates", type=int, nargs="+", default=[200_000, 50_000])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    for rate in options.rates:
        print(f"\n{rate:,} pulses/s\n\n| air | F1 | precision | recall | ms a scan | ns a return |")
        print("|---|---|---|---|---|---|")
        for name, noise in CASES.items():
            if options.only in name:
                runs = [score(noise, (), rate, seed) for seed in options.seeds]
                hit, false, missed = (sum(getattr(r, n) for r in runs) for n in ("hit", "false", "missed"))
                f1 = 2 * hit / max(1, 2 * hit + false + missed)
                seconds, returns = sum(r.seconds for r in runs), sum(r.returns for r in runs)
                ms = 1000 * seconds / len(runs) / 120
                print(
                    f"| {name} | {f1:.3f} | {hit / max(1, hit + false):.3f} "
                    f"| {hit / max(1, hit + missed):.3f} "
                    f"| {ms:.2f} | {1e9 * seconds / returns:.0f} |",
                    flush=True,
                )
        print("\n| air | hazard | returns | of them specks | first kept after, s | scans without it |")
        print("|---|---|---|---|---|---|")
        for name, noise in CASES.items():
            for hazard, solids in HAZARDS.items():
                if solids and options.only in name:
                    for seed in options.seeds:
                        r = score(noise, solids, rate, seed)
                        late = (
                            "-" if r.kept_ns is None or r.first_ns is None
                            else f"{(r.kept_ns - r.first_ns) * 1e-9:.2f}"
                        )  # fmt: skip
                        print(
                            f"| {name} | {hazard} | {r.on_hazard} "
                            f"| {r.lost / max(1, r.on_hazard):.1%} | {late} "
                            f"| {r.gaps} of {r.scans} |",
                            flush=True,
                        )


if __name__ == "__main__":
    main()
