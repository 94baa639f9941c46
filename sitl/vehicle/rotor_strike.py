"""Rotor strike: a disc that meets anything solid, beside it, below it or above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sitl.vehicle.rigid_body import F64, State, rotate
from sitl.world.world import World

SPOKES = 16
AXES = np.eye(3)
_TURN = np.arange(SPOKES) * (2 * np.pi / SPOKES)
RIM = np.vstack([np.zeros(2), np.column_stack([np.cos(_TURN), np.sin(_TURN)])])
"""Hub and rim of a disc of 1 m, forward and right, (1 + SPOKES, 2)."""


@dataclass(frozen=True, slots=True)
class Rotor:
    """Disc around all that turns: its radius, and its height over the feet."""

    radius_m: float = 0.45
    height_m: float = 0.3

    def points(self, state: State) -> F64:
        """Return the hub and points of the rim, (1 + SPOKES, 3) ENU, m."""
        north_east_down = np.array([rotate(state.quat_wxyz, axis) for axis in AXES])
        forward, right, down = north_east_down[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
        points: F64 = state.pos_enu_m - self.height_m * down + self.radius_m * (RIM @ [forward, right])
        return points


def struck(world: World, rotor: Rotor, before: State, now: State) -> bool:
    """Return whether the disc meets a solid, or did on its way from one state to the next.

    Leaves and stalks of the plant layers bend and do not count; water is judged at the touchdown.
    """
    points = rotor.points(now)
    spokes = np.broadcast_to(points[0], points[1:].shape), points[1:]
    ways = rotor.points(before), points
    start, end = (np.vstack(pair) for pair in zip(spokes, ways, strict=True))
    length = np.linalg.norm(end - start, axis=1)
    moved = length > 1e-6
    start, end, length = start[moved], end[moved], length[moved]
    no_leaves = np.empty((len(start), 0))
    met = world.cross(start, (end - start) / length[:, None], float(length.max()), no_leaves).range_m
    return bool((met <= length).any())
