"""Rotor strike: a disc that meets anything solid, beside it, below it or above."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from sitl.vehicle.rigid_body import F64, State, rotate
from sitl.world.world import World

AXES = np.eye(3)
LEAST_SPACING_M, RINGS = 0.06, 14  # between points of the disc, and of its radius where that is more


@dataclass(frozen=True, slots=True)
class Rotor:
    """Disc around all that turns: its radius, and its height over the feet."""

    radius_m: float = 0.45
    height_m: float = 0.3

    def points(self, state: State) -> F64:
        """Return the points of `web` in the world, (n, 3) ENU, m."""
        north_east_down = np.array([rotate(state.quat_wxyz, axis) for axis in AXES])
        forward, right, down = north_east_down[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
        plane, _ = web(self.radius_m)
        points: F64 = state.pos_enu_m - self.height_m * down + plane @ [forward, right]
        return points


@functools.lru_cache(maxsize=4)
def web(radius_m: float) -> tuple[F64, F64]:
    """Return points all over a disc (n, 2), forward and right of its hub (m), and pairs of them (m, 2).

    The points are on rings; the pairs are neighbours on a ring, and on the way from the hub to the rim.
    """
    spacing_m = max(LEAST_SPACING_M, radius_m / RINGS)
    rings = math.ceil(radius_m / spacing_m)
    places, pairs = [np.zeros((1, 2))], []
    count = math.ceil(2 * math.pi * radius_m / spacing_m)
    turn = np.arange(count) * (2 * np.pi / count)
    spoke = np.column_stack([np.cos(turn), np.sin(turn)])
    own = np.arange(count)
    for ring in range(1, rings + 1):
        first = 1 + (ring - 1) * count
        places.append(spoke * (radius_m * ring / rings))
        pairs.append(np.column_stack([first + own, first + np.roll(own, -1)]))
        pairs.append(
            np.column_stack([np.zeros(count, int) if ring == 1 else first - count + own, first + own])
        )
    return np.vstack(places), np.vstack(pairs)


def struck(world: World, rotor: Rotor, before: State, now: State) -> bool:
    """Return whether the disc meets a solid, or did on its way from one state to the next.

    Leaves and stalks of the plant layers bend and do not count; water is judged at the touchdown.
    """
    x, y, z = (float(v) for v in now.pos_enu_m)
    moved_m = float(np.linalg.norm(now.pos_enu_m - before.pos_enu_m))
    reach_m = rotor.radius_m + rotor.height_m + moved_m
    if z - reach_m > world.highest_about_m(x, y, reach_m):
        return False
    points, (_, pairs) = rotor.points(now), web(rotor.radius_m)
    start = np.vstack([points[pairs[:, 0]], rotor.points(before)])
    end = np.vstack([points[pairs[:, 1]], points])
    length = np.linalg.norm(end - start, axis=1)
    moved = length > 1e-6
    start, end, length = start[moved], end[moved], length[moved]
    no_leaves = np.empty((len(start), 0))
    met = world.cross(start, (end - start) / length[:, None], float(length.max()), no_leaves).range_m
    return bool((met <= length).any())
