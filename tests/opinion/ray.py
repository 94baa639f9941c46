"""Simulated LiDAR rays against Embree and MuJoCo on the same geometry.

The reference of a ray is the nearer of two: MuJoCo's distance to the solids, exact in double precision, and
the distance to the ground, which Embree brackets between two triangulations and bisection of the height
field's definition narrows. Embree over the triangulated solids is a third opinion on these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl import scenes
from sitl.scenes import Scene
from sitl.world.hits import GROUND, NOTHING
from sitl.world.primitives import Wire
from tests.opinion.meshes import ground_triangles, heights, inscribed_gap_m, solid_triangles
from tests.opinion.ray_casters import MISS, Embree, MuJoCo
from tests.opinion.rays import Rays, sets

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Flags = NDArray[np.bool_]
FAR_M = 1e4
SAME_M = 1e-6
TESSELLATED_M = 1e-3
NUDGE_RAD = (1e-9, 1e-7, 1e-6)
SAMPLES, LONG_SAMPLES, FINER, HALVINGS = 65, 20_001, 100, 60


@dataclass(frozen=True, slots=True)
class Answers:
    """Range (NaN for none), surface (code of ``hits``) and cosine of incidence of rays."""

    range_m: F64
    surface: I64
    cosine: F64


@dataclass(frozen=True, slots=True)
class Comparison:
    """Differences of one kind of rays; differences in metres and in the cosine on equal surfaces only."""

    kind: str
    rays: int
    same_hit: int
    same_surface: int
    range_m: F64
    cosine: F64
    embree_excess_m: F64
    """By how much Embree's range to the same solid differs more than its triangles may."""
    causes: Counter[str]


class Reference:
    """Geometry of a scene in the two ray casters."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._ground, self._solids = scene, scene.world.ground, scene.world.solids
        self._hulls = [self._embree(ground_triangles(self._ground, d)) for d in ("higher", "lower")]
        self._mujoco = MuJoCo(self._solids)
        parts = [solid_triangles(solid) for solid in self._solids]
        self._tessellated = None
        if parts:
            owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
            self._tessellated = Embree(np.concatenate(parts), owner)
        self._gap_m = np.array([inscribed_gap_m(solid) for solid in self._solids] or [0.0])

    @staticmethod
    def _embree(triangles: F64) -> Embree:
        return Embree(triangles, np.zeros(len(triangles), np.int64))

    def answers(self, rays: Rays, finer: int = 1) -> Answers:
        """Return the reference of rays; `finer` times as many samples of the ground along a ray."""
        solid_m, solid, normals = self._mujoco.cast(rays.origins, rays.directions)
        ground_m = self._ground_ranges(rays, finer)
        on_ground = ~(solid_m <= ground_m) & np.isfinite(ground_m)
        range_m = np.where(on_ground, ground_m, solid_m)
        surface = np.where(on_ground, GROUND, np.where(np.isfinite(solid_m), solid, NOTHING))
        at = rays.origins + np.nan_to_num(ground_m)[:, np.newaxis] * rays.directions
        normals = np.where(on_ground[:, np.newaxis], self._ground_normals(at), normals)
        return Answers(range_m, surface, np.abs(np.einsum("ij,ij->i", normals, rays.directions)))

    def wire_end(self, rays: Rays) -> Flags:
        """Return the mask of rays that MuJoCo ends at the flat end of a wire, where the world has none."""
        _, solid, normals = self._mujoco.cast(rays.origins, rays.directions)
        ends = np.zeros(len(rays), np.bool_)
        for k in np.flatnonzero(solid != MISS):
            wire = self._solids[solid[k]]
            if isinstance(wire, Wire):
                along = np.subtract(wire.end_enu_m, wire.start_enu_m)
                ends[k] = abs(normals[k] @ along) > 0.999 * np.linalg.norm(along)
        return ends

    def tessellated_excess_m(self, rays: Rays, answers: Answers) -> F64:
        """Return the differences to Embree on solids in excess of what the triangles explain."""
        if self._tessellated is None:
            return np.empty(0)
        range_m, solid, normals = self._tessellated.cast(rays.origins, rays.directions)
        same = (solid == answers.surface) & (solid != MISS)
        slant = np.abs(np.einsum("ij,ij->i", normals, rays.directions))[same]
        allowed = self._gap_m[solid[same]] / np.maximum(slant, 1e-3)
        excess: F64 = np.abs(range_m[same] - answers.range_m[same]) - allowed
        return excess

    def _ground_ranges(self, rays: Rays, finer: int) -> F64:
        """Return the first crossing of the bilinear ground, NaN for none."""
        first, last = (hull.cast(rays.origins, rays.directions)[0] for hull in self._hulls)
        range_m = np.full(len(rays), np.nan)
        margin = 1e-3  # of single precision
        whole = np.isfinite(first) & np.isfinite(last)
        for own, samples in ((whole, SAMPLES), (np.isfinite(first) & ~whole, LONG_SAMPLES)):
            k = np.flatnonzero(own)
            if k.size:
                end = last[k] if samples == SAMPLES else np.minimum(first[k] + 100.0, self._leaves_m(rays, k))
                start = np.maximum(0.0, first[k] - margin)
                range_m[k] = self._crossing(
                    rays.origins[k], rays.directions[k], start, end + margin, finer * samples
                )
        return range_m

    def _crossing(self, origins: F64, directions: F64, start: F64, end: F64, samples: int) -> F64:
        def above(t: F64) -> F64:
            x, y, z = (origins + t[:, np.newaxis] * directions).T
            height: F64 = z - heights(self._ground, x, y)
            return height

        low, high, found = start.copy(), start.copy(), np.zeros(len(start), np.bool_)
        for step in range(1, samples):
            t = start + (end - start) * (step / (samples - 1))
            below = (above(t) <= 0.0) & ~found
            high[below], found = t[below], found | below
            low = np.where(found, low, t)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            over = above(middle) > 0.0
            low, high = np.where(over, middle, low), np.where(over, high, middle)
        return np.where(found, high, np.nan)

    def _leaves_m(self, rays: Rays, k: I64) -> F64:
        """Return where rays leave the ground's extent."""
        x0, y0, x1, y1 = self._ground.extent_m
        o, d = rays.origins[k, :2], rays.directions[k, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            walls = np.where(d > 0, (np.array([x1, y1]) - o) / d, (np.array([x0, y0]) - o) / d)
        leaves: F64 = np.nanmin(walls, axis=1)
        return leaves

    def _ground_normals(self, at: F64) -> F64:
        step = 1e-7
        x, y, _ = at.T
        east = (heights(self._ground, x + step, y) - heights(self._ground, x - step, y)) / (2 * step)
        north = (heights(self._ground, x, y + step) - heights(self._ground, x, y - step)) / (2 * step)
        normal = np.column_stack([-east, -north, np.ones(len(at))])
        unit: F64 = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        return unit


def simulated(scene: Scene, rays: Rays) -> Answers:
    """Return the simulator's answers."""
    c = scene.world.cross(rays.origins, rays.directions, FAR_M, np.zeros((len(rays), 0)))
    return Answers(c.range_m, c.hit, c.cosine)


def compare(scene: Scene, reference: Reference, rays: Rays) -> Comparison:
    """Return the differences of one kind of rays."""
    mine, other = simulated(scene, rays), reference.answers(rays)
    odd = _different(mine, other)
    # A ray may dip into the ground for millimetres, between two samples of the reference.
    some = Rays(rays.kind, rays.origins[odd], rays.directions[odd])
    better = reference.answers(some, FINER)
    for name in ("range_m", "surface", "cosine"):
        getattr(other, name)[odd] = getattr(better, name)
    odd = _different(mine, other)
    same, hit = mine.surface == other.surface, np.isfinite(mine.range_m)
    apart = np.abs(mine.range_m - other.range_m)
    return Comparison(
        rays.kind,
        len(rays),
        int(np.count_nonzero(hit == np.isfinite(other.range_m))),
        int(np.count_nonzero(same)),
        apart[same & hit],
        np.abs(mine.cosine - other.cosine)[same & hit & ~odd],
        reference.tessellated_excess_m(rays, mine),
        _causes(scene, reference, rays, other, odd),
    )


def _different(mine: Answers, other: Answers) -> Flags:
    with np.errstate(invalid="ignore"):
        return (mine.surface != other.surface) | (np.abs(mine.range_m - other.range_m) > SAME_M)


def _causes(scene: Scene, reference: Reference, rays: Rays, other: Answers, odd: Flags) -> Counter[str]:
    """Return the causes of differences: the end of a wire, an edge within rounding, or none known."""
    k = np.flatnonzero(odd)
    causes: Counter[str] = Counter()
    if not k.size:
        return causes
    some = Rays(rays.kind, rays.origins[k], rays.directions[k])
    found = simulated(scene, some)
    tie = np.abs(found.range_m - other.range_m[k]) <= SAME_M
    causes["faces that coincide"] += int(np.count_nonzero(tie))
    end = reference.wire_end(some) & ~tie
    causes["end of a wire"] += int(np.count_nonzero(end))
    left = ~tie & ~end
    for nudge in NUDGE_RAD:
        close = np.zeros(len(k), np.bool_)
        for axis in np.concatenate([np.eye(3), -np.eye(3)]):
            turned = some.directions + nudge * axis
            turned /= np.linalg.norm(turned, axis=1, keepdims=True)
            tried = simulated(scene, Rays(rays.kind, some.origins, turned))
            with np.errstate(invalid="ignore"):
                near = np.abs(tried.range_m - other.range_m[k]) < 0.01
            near |= np.isnan(tried.range_m) & np.isnan(other.range_m[k])
            close |= (tried.surface == other.surface[k]) & near
        causes[f"edge within {nudge:.0e} rad"] += int(np.count_nonzero(close & left))
        left &= ~close
    for n in np.flatnonzero(left)[:5]:
        print(
            f"  unexplained in {scene.name}, {rays.kind}: from {some.origins[n].tolist()} along "
            f"{some.directions[n].tolist()}: simulator {found.range_m[n]} m to {found.surface[n]}, "
            f"reference {other.range_m[k[n]]} m to {other.surface[k[n]]}"
        )
    causes["none known"] += int(np.count_nonzero(left))
    return +causes


def truth_differences(scene: Scene, reference: Reference, rays: Rays) -> F64:
    """Return the differences of the truth's top surface to vertical rays of the reference."""
    if scene.world.layers is not None:
        return np.empty(0)
    top, _ = scene.world.surface(rays.origins[:, 0], rays.origins[:, 1])
    seen = rays.origins[:, 2] - reference.answers(rays).range_m
    differences: F64 = np.abs(top - seen)
    return differences


def run(names: Sequence[str], seed: int) -> int:
    """Compare scenes and print tables; 1 if a difference has no known cause."""
    by_kind: dict[str, list[Comparison]] = {}
    truth, known = [], True
    print(HEAD)
    for number, name in enumerate(names):
        scene = scenes.build(name, seed)
        reference, found = Reference(scene), []
        for rays in sets(scene, np.random.default_rng([seed, number])):
            if not len(rays):
                continue
            found.append(compare(scene, reference, rays))
            by_kind.setdefault(rays.kind, []).append(found[-1])
            if rays.kind == "vertical":
                truth.append(truth_differences(scene, reference, rays))
        known &= not any(c.causes["none known"] for c in found)
        print(_line(name, found), flush=True)
    print("\n" + HEAD)
    for kind, found in by_kind.items():
        print(_line(kind, found))
    print(_line("all", [c for found in by_kind.values() for c in found]))
    off = np.concatenate(truth)
    print(f"\ntop surface of the truth: {len(off)} places, at most {off.max(initial=0.0):.1e} m")
    return int(not known)


HEAD = """| | rays | returns | other hit or miss | other surface | range: median, p99, max, m | \
cosine: p99.9, max | Embree on solids, beyond its triangles | causes |
|---|---|---|---|---|---|---|---|---|"""


def _line(name: str, found: Sequence[Comparison]) -> str:
    rays = sum(c.rays for c in found)
    range_m, cosine = (np.concatenate([getattr(c, part) for c in found]) for part in ("range_m", "cosine"))
    excess = np.concatenate([c.embree_excess_m for c in found] or [np.zeros(1)])
    causes = sum((c.causes for c in found), Counter[str]())
    p50, p99 = np.quantile(range_m, [0.5, 0.99])
    p999 = np.quantile(cosine, 0.999)
    beyond = int(np.count_nonzero(excess > TESSELLATED_M))
    return (
        f"| {name} | {rays} | {len(range_m)} | {rays - sum(c.same_hit for c in found)} | "
        f"{rays - sum(c.same_surface for c in found)} | {p50:.0e}, {p99:.0e}, {range_m.max():.0e} | "
        f"{p999:.0e}, {cosine.max():.0e} | {beyond} of {len(excess)} | "
        + ", ".join(f"{cause} {count}" for cause, count in causes.items())
        + " |"
    )
