"""Recall, assigned returns and false tracks of moving objects, by the simulator's truth of each return.

python -m tests.bench.moving crossings --runs 14 --out crossings.json
python -m tests.bench.moving static --scenes swaying_trees --runs 20

The vehicle hovers or sinks at 5 to 20 m with a Mid-360 that looks down. A run of `crossings` has one object
of each kind on straight ways; a run of `static` has none, and every track in it is a false one.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import params
from sitl import scenes
from sitl.intruders import Cyclist, Dog, PassingCar, Runner, Walker
from sitl.sensors.mid360 import Mid360
from sitl.sensors.mid360_pattern import ELEVATION_MAX_DEG, ELEVATION_MIN_DEG
from sitl.world.hits import MOVERS
from sitl.world.world import World
from slz import LocalFrame, MovingObject, MovingObjects, Nearby, Pipeline, Scan
from slz.moving.raised_returns import Ground, RecentGround, raised_returns
from slz.window import join

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
FRAME = LocalFrame(47.0, 8.0, 400.0)
KINDS = (Walker, Runner, Dog, Cyclist, PassingCar)
CENTRES = {"stadium": (-40.0, 40.0), "swaying_trees": (0.0, 0.0), "dense": (0.0, 0.0), "plain": (0.0, 0.0)}
ABOUT_M = {"stadium": 25.0, "swaying_trees": 22.0, "dense": 22.0, "plain": 15.0}  # of a hover from there
STATIC_CENTRES = CENTRES | {"stadium": (67.0, -22.0)}  # the entrance, among hedges, bollards and trees
SCAN_NS, MOVED_NS, S = 50_000_000, 10_000_000, 1_000_000_000
PLACE_NOISE_M, TURN_NOISE_RAD = 0.03, math.radians(0.1)  # of the pose, constant within a window
NEAREST_M = 0.6  # `lidar_min_m`
WARM_NS, STARTS_NS, LAST_NS = 3 * S, 4 * S, 20 * S  # the map begins; objects start; a run ends
WITHIN_M, WITHIN_NS = 25.0, S // 2  # from when an object is in view, until a track must follow it
FROM_M, PASSES_M = 27.0, 20.0
TRACK_M, ASSIGNED_M = 1.0, 0.3  # beside an object's radius: of a track, and of its returns
EDGES_M = (0.0, 10.0, 15.0, 20.0, 25.0)
RISE_M = 0.25  # between two places of a way, 0.5 m apart: over more it does not lead
LEAST_HEIGHT_M = 5.0


@dataclass(frozen=True, slots=True)
class Hover:
    """Place (3,) at the time 0, sink rate, height over the ground at which it ends, and heading."""

    start_m: Floats
    sink_ms: float
    lowest_m: float
    heading_rad: float

    def pose_at(self, stamps_ns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return positions (n, 3) and attitudes (n, 4) of the vehicle."""
        position = np.tile(self.start_m, (len(stamps_ns), 1))
        position[:, 2] = np.maximum(position[:, 2] - self.sink_ms * stamps_ns * 1e-9, self.lowest_m)
        half = self.heading_rad / 2
        return position, np.tile([math.cos(half), 0.0, 0.0, math.sin(half)], (len(stamps_ns), 1))


@dataclass(slots=True)
class Passer:
    """Object on a straight way, and what became of it."""

    kind: str
    parts: tuple[Any, ...]
    from_m: Floats
    velocity_ms: Floats
    start_ns: int
    end_ns: int
    near_ns: int | None = None  # since when it is within `WITHIN_M`, and in view besides
    view_ns: int | None = None
    moments: list[tuple[float, bool, bool]] = field(default_factory=list)  # range, is in view, is followed
    judged: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def radius_m(self) -> float:
        return max(math.hypot(part.length_m, part.width_m) / 2 for part in self.parts)

    @property
    def height_m(self) -> float:
        return max(float(part.bounds()[5]) for part in self.parts)

    def at(self, now_ns: int) -> Floats:
        """Return its place (2,)."""
        place: Floats = self.from_m + self.velocity_ms * ((now_ns - self.start_ns) * 1e-9)
        return place

    def move(self, world: World, now_ns: int) -> None:
        """Put it into the world, move it, or take it away."""
        inside = self.start_ns <= now_ns < self.end_ns
        if not inside:
            if self.kind in world.movers:
                world.remove(self.kind)
            return
        place, yaw = self.at(now_ns).tolist(), math.atan2(self.velocity_ms[1], self.velocity_ms[0])
        if self.kind in world.movers:
            world.move(self.kind, place[0], place[1], yaw)
        else:
            world.add_mover(self.kind, self.parts, place[0], place[1], yaw)


@dataclass(slots=True)
class Tally:
    """Returns by truth and by the detector: common to both, in either; time, points, and false tracks."""

    both: int = 0
    either: int = 0
    both_over: int = 0  # the same of returns over the bound alone
    either_over: int = 0
    seconds: float = 0.0
    points: int = 0
    scans: int = 0
    numbers: set[int] = field(default_factory=set)
    false: dict[int, list[float]] = field(default_factory=dict)


def hover(
    name: str, world: World, rng: np.random.Generator, centres: dict[str, tuple[float, float]]
) -> Hover:
    """Return a hover over a scene, clear of everything."""
    while True:
        turn, away_m = float(rng.uniform(0, 2 * math.pi)), ABOUT_M[name] * math.sqrt(float(rng.uniform()))
        x, y = (c + away_m * f(turn) for c, f in zip(centres[name], (math.cos, math.sin), strict=True))
        height_m = float(rng.uniform(LEAST_HEIGHT_M, 20.0))
        foot = world.height_m(x, y)
        if foot + LEAST_HEIGHT_M > world.highest_about_m(x, y, 1.5) + 2.0:
            break
    sink_ms = float(rng.choice([0.0, 0.3, 0.5]))
    heading = float(rng.uniform(0, 2 * math.pi))
    return Hover(np.array([x, y, foot + height_m]), sink_ms, foot + LEAST_HEIGHT_M, heading)


def passer(kind: type[Walker], world: World, around_m: Floats, rng: np.random.Generator) -> Passer:
    """Return an object on an even way that passes a place (2,) within `PASSES_M`."""
    for _ in range(2000):
        bearing, beside_m = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(-PASSES_M, PASSES_M))
        along = np.array([math.cos(bearing), math.sin(bearing)])
        half_m = math.sqrt(FROM_M**2 - beside_m**2)
        middle = around_m + beside_m * np.array([-along[1], along[0]])
        way = middle + np.arange(-half_m, half_m, 0.5)[:, None] * along
        heights = np.array(
            [
                world.surface(*(way + aside * np.array([-along[1], along[0]])).T)[0]
                for aside in (-1.0, 0.0, 1.0)
            ]
        )
        if np.nan_to_num(np.abs(np.diff(heights, axis=1)).max(), nan=1e3) < RISE_M:
            break
    else:
        raise ValueError("no even way was found")
    speed = float(rng.uniform(*kind.speed_ms))
    start_ns = STARTS_NS + int(rng.uniform(0, 4) * S)
    lasts_ns = round(2 * half_m / speed * S)
    return Passer(
        kind.what, kind.parts, middle - half_m * along, speed * along, start_ns, start_ns + lasts_ns
    )


class Run:
    """One hover, with its objects, through map and detector."""

    def __init__(self, name: str, number: int, rate_hz: int, *, crossed: bool) -> None:
        rng = np.random.default_rng([number, scenes.NAMES.index(name)])
        self._rng = rng
        self.world = scenes.build(name, number % 5).world
        self.world.wind_ms = float(rng.uniform(3.0, 12.0))
        self.hover = hover(name, self.world, rng, CENTRES if crossed else STATIC_CENTRES)
        around = self.hover.start_m[:2]
        self.passers = [passer(kind, self.world, around, rng) for kind in KINDS] if crossed else []
        self._lidar = Mid360(rng, point_rate_hz=rate_hz)
        parameters = params.load("quadcopter", [])
        self._angle_noise_rad = math.radians(parameters.angle_noise_deg)
        self._pipeline, self._watch = Pipeline(parameters), MovingObjects(self._angle_noise_rad)
        self._recent, self._newest_ns = RecentGround(), 0
        self._ground: Ground | None = None
        self._turn = self._shift = np.zeros(3)
        self.window_ns = int(rng.choice([S // 2, S]))
        self.tally = Tally()

    def fly(self, seconds: float) -> None:
        """Fly for a time, from the beginning of the map."""
        pending: list[Scan] = []
        for number in range(round(seconds * S / SCAN_NS)):
            start_ns = number * SCAN_NS
            if start_ns % self.window_ns == 0:
                if pending:
                    self._use(self._pipeline.process(join(pending)).nearby)
                pending = []
                self._turn = self._rng.normal(0, TURN_NOISE_RAD, 3)
                self._shift = self._rng.normal(0, PLACE_NOISE_M, 3)
            scan, owner = self._scan(start_ns)
            pending.append(scan)
            began = time.thread_time()
            found = self._watch.add(scan)
            self.tally.seconds += time.thread_time() - began
            self.tally.points += len(scan)
            self._newest_ns = int(scan.stamp_ns[-1])
            self.tally.scans += 1
            if start_ns >= WARM_NS:
                self._judge(scan, owner, found, start_ns + SCAN_NS - MOVED_NS // 2)

    def _use(self, nearby: Nearby | None) -> None:
        self._watch.use_ground(nearby)
        self._ground = None if nearby is None else self._recent.add(nearby, self._newest_ns)

    def _scan(self, start_ns: int) -> tuple[Scan, NDArray[np.int64]]:
        """Return a scan, and the number of the object that each return is of; -1 for none."""
        points, stamps, owners = [], [], []
        lidar, mount = self._lidar, self._lidar.mount
        step_ns = MOVED_NS if self.passers else SCAN_NS
        for now_ns in range(start_ns, start_ns + SCAN_NS, step_ns):
            for one in self.passers:
                one.move(self.world, now_ns + step_ns // 2)
            shots = lidar.shots(now_ns, now_ns + step_ns, self.hover.pose_at, self.world)
            good = shots.echoes.range_m >= NEAREST_M
            stamp = lidar.stamps_ns(shots)[good]
            position, attitude = self.hover.pose_at(stamp)
            own = mount.lever_enu_m(attitude) + mount.to_enu(lidar.points_m(shots)[good], attitude)
            points.append(position + own + np.cross(self._turn, own) + self._shift)
            stamps.append(stamp)
            owners.append(self._owner(shots.hits.strongest[good]))
        position, attitude = self.hover.pose_at(stamps[-1][-1:])
        sensor = (position + mount.lever_enu_m(attitude))[0] + self._shift
        return Scan(np.concatenate(points), np.concatenate(stamps), sensor, FRAME), np.concatenate(owners)

    def _owner(self, hit: NDArray[np.int64]) -> NDArray[np.int64]:
        kinds = [one.kind for one in self.passers]
        of_part = [kinds.index(m.name) for m in self.world.movers.values() for _ in m.parts]
        owner = np.full(len(hit), -1, np.int64)
        if of_part:
            mine = hit >= MOVERS
            owner[mine] = np.array(of_part)[hit[mine] - MOVERS]
        return owner

    # ---- against truth --------------------------------------------------------------------------

    def _judge(
        self, scan: Scan, owner: NDArray[np.int64], found: tuple[MovingObject, ...], now_ns: int
    ) -> None:
        present = [one for one in self.passers if one.start_ns <= now_ns < one.end_ns]
        follows = False
        for one in present:
            sensor = self.hover.pose_at(np.array([now_ns]))[0][0]
            place = one.at(now_ns)
            range_m = float(np.linalg.norm([*(place - sensor[:2]), self._middle_m(one) - sensor[2]]))
            is_near = range_m <= WITHIN_M
            in_view = is_near and self._in_view(one, now_ns)
            tracks = [
                o
                for o in found
                if np.hypot(*(o.at(now_ns) - place)) <= TRACK_M + max(one.radius_m, o.radius_m)
            ]
            self.tally.numbers.update(o.number for o in tracks)
            is_followed = bool(tracks)
            follows |= is_followed
            one.near_ns = (one.near_ns or now_ns) if is_near else None
            one.view_ns = (one.view_ns or now_ns) if in_view else None
            for name, since_ns in (("near", one.near_ns), ("in_view", one.view_ns)):
                self._note(one, name, since_ns, now_ns, range_m, is_followed)
            if one.near_ns is not None and now_ns - one.near_ns >= WITHIN_NS:
                seen = one.view_ns is not None and now_ns - one.view_ns >= WITHIN_NS
                one.moments.append((range_m, seen, is_followed))
        for o in found:
            away = float(np.hypot(*(o.enu_m - self.hover.start_m[:2])))
            if o.number not in self.tally.numbers and away <= WITHIN_M:
                self.tally.false.setdefault(o.number, [now_ns * 1e-9, *o.enu_m.tolist(), o.height_m])
        for number in self.tally.numbers:
            self.tally.false.pop(number, None)
        if follows:
            self._compare(scan, owner >= 0, found)

    def _note(
        self, one: Passer, name: str, since_ns: int | None, now_ns: int, range_m: float, followed: bool
    ) -> None:
        """Take down the first time that an object stays for `WITHIN_NS`, and when it is followed then."""
        if name not in one.judged:
            if since_ns is not None and now_ns - since_ns >= WITHIN_NS:
                after_s = (now_ns - since_ns) * 1e-9 if followed else math.inf
                one.judged[name] = {"since": since_ns, "after_s": after_s, "range_m": range_m}
        elif followed and math.isinf(one.judged[name]["after_s"]):
            one.judged[name]["after_s"] = (now_ns - one.judged[name]["since"]) * 1e-9

    def _middle_m(self, one: Passer) -> float:
        return self.world.movers[one.kind].z_m + one.height_m / 2

    def _in_view(self, one: Passer, now_ns: int) -> bool:
        """Return whether the sensor's field of view holds the middle of an object, and nothing hides it."""
        mount, (position, attitude) = self._lidar.mount, self.hover.pose_at(np.array([now_ns]))
        eye = (position + mount.lever_enu_m(attitude))[0]
        way = np.array([*one.at(now_ns), self._middle_m(one)]) - eye
        range_m = float(np.linalg.norm(way))
        axes = mount.to_enu(np.array([[0.0, 0.0, 1.0]]), attitude)[0]
        elevation = math.degrees(math.asin(float(way @ axes) / range_m))
        if not ELEVATION_MIN_DEG <= elevation <= ELEVATION_MAX_DEG:
            return False
        met = self.world.cross(
            eye[None], (way / range_m)[None], 80.0, np.full((1, 1), np.inf), time_s=np.array([now_ns * 1e-9])
        )
        return self.world.mover_of(int(met.hit[0])) == one.kind

    def _compare(self, scan: Scan, truth: Flags, found: tuple[MovingObject, ...]) -> None:
        """Count the returns of objects by truth, and those that the detector assigns to what it found."""
        raised = None
        if self._ground is not None:
            raised = raised_returns(scan, self._ground, self._angle_noise_rad)
        over = np.zeros(len(scan), bool)
        if raised is not None:
            row = np.dtype((np.void, 24))
            rows = (
                np.ascontiguousarray(p).view(row).ravel() for p in (scan.points_enu_m, raised.points_enu_m)
            )
            over = np.isin(*rows)
        assigned = np.zeros(len(scan), bool)
        for o in found:
            after_s = (scan.stamp_ns - o.stamp_ns)[:, None] * 1e-9
            away = np.hypot(*(scan.points_enu_m[:, :2] - o.enu_m - after_s * o.velocity_ms).T)
            assigned |= over & (away <= o.radius_m + ASSIGNED_M)
        self.tally.both += int((truth & assigned).sum())
        self.tally.either += int((truth | assigned).sum())
        self.tally.both_over += int((truth & over & assigned).sum())
        self.tally.either_over += int((truth & over | assigned).sum())


def _share(hits: list[bool]) -> str:
    return f"{np.mean(hits):.3f} of {len(hits)}" if hits else "-"


def crossings(names: list[str], runs: int, first: int, rate_hz: int) -> dict[str, Any]:
    """Fly crossings; return the figures."""
    passers, total = [], Tally()
    strays = 0
    seconds = 0.0
    for number in range(first, first + runs):
        run = Run(names[number % len(names)], number, rate_hz, crossed=True)
        lasts_s = min(LAST_NS, max(one.end_ns for one in run.passers)) / S
        run.fly(lasts_s)
        seconds += lasts_s
        passers += run.passers
        strays += len(run.tally.false)
        for name in ("both", "either", "both_over", "either_over", "seconds", "points"):
            setattr(total, name, getattr(total, name) + getattr(run.tally, name))
        told = {
            "run": number,
            "window_s": run.window_ns / S,
            "height_m": round(float(run.hover.start_m[2]), 1),
            "sink": run.hover.sink_ms,
            "false": list(run.tally.false.values()),
            "passers": {p.kind: (round(float(np.hypot(*p.velocity_ms)), 1), p.judged) for p in run.passers},
        }
        print(json.dumps(told), file=sys.stderr, flush=True)
    figures: dict[str, Any] = {"crossings": len(passers), "minutes": seconds / 60}
    for name in ("in_view", "near"):
        judged = [(p, p.judged[name]) for p in passers if name in p.judged]
        for after_s in (0.5, 0.75, 1.0, 1.5):
            figures[f"{name}: followed within {after_s:g} s"] = _share(
                [j["after_s"] <= after_s + 1e-6 for _, j in judged]
            )
        for kind in KINDS:
            figures[f"{name}: {kind.what}"] = _share(
                [j["after_s"] <= 0.5 + 1e-6 for p, j in judged if p.kind == kind.what]
            )
        moments = [(p.kind, *m) for p in passers for m in p.moments if m[1] or name == "near"]
        figures[f"{name}: moments"] = _share([m[3] for m in moments])
        for low, high in itertools.pairwise(EDGES_M):
            at = [m for m in moments if low < m[1] <= high]
            figures[f"{name}: moments {low:g} to {high:g} m"] = (
                _share([m[3] for m in at])
                + " "
                + " ".join(f"{kind.what} {_share([m[3] for m in at if m[0] == kind.what])}" for kind in KINDS)
            )
        for kind in KINDS:
            figures[f"{name}: moments {kind.what}"] = _share([m[3] for m in moments if m[0] == kind.what])
    figures["iou"] = total.both / max(1, total.either)
    figures["iou of raised returns"] = total.both_over / max(1, total.either_over)
    figures["false tracks"] = strays
    figures["ns a point"] = 1e9 * total.seconds / max(1, total.points)
    return figures


def static(name: str, runs: int, first: int, rate_hz: int, seconds: float) -> dict[str, Any]:
    """Fly over a scene without objects; return the number of false tracks."""
    false, spent, points = 0, 0.0, 0
    for number in range(first, first + runs):
        run = Run(name, number, rate_hz, crossed=False)
        run.fly(seconds)
        false += len(run.tally.false)
        spent, points = spent + run.tally.seconds, points + run.tally.points
        told = {
            "run": number,
            "hover": run.hover.start_m.round(1).tolist(),
            "wind": round(run.world.wind_ms, 1),
            "false": list(run.tally.false.values()),
        }
        print(json.dumps(told), file=sys.stderr, flush=True)
    minutes = runs * seconds / 60
    return {
        "scene": name,
        "minutes": minutes,
        "false tracks": false,
        "in 10 min": 10 * false / minutes,
        "ns a point": 1e9 * spent / max(1, points),
    }


def main() -> None:
    """Fly and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["crossings", "static"])
    parser.add_argument("--runs", type=int, default=14)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", nargs="+", default=["swaying_trees", "stadium"])
    parser.add_argument("--rate-hz", type=int, default=200_000)
    parser.add_argument("--seconds", type=float, default=30.0, help="of a run of static")
    parser.add_argument("--out", type=Path)
    own = parser.parse_args()
    if own.what == "crossings":
        told = [crossings(own.scenes, own.runs, own.first, own.rate_hz)]
    else:
        told = [static(name, own.runs, own.first, own.rate_hz, own.seconds) for name in own.scenes]
    for figures in told:
        print(json.dumps(figures, indent=1))
    if own.out:
        own.out.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
