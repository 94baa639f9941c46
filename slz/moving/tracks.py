"""Tracks of objects over the ground: which move, where to, and how fast.

A constant-velocity Kalman filter for each object, and the assignment of least distance between predictions
and groups within a gate (scipy's). What stands still after it was first seen becomes part of the map with
the next window; it has a track until then, and does not count as moving.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from slz.moving.groups import Group

PLACE_M = 0.12, 0.25  # standard deviation of a group's middle: returns show one side, then another
OF_RADIUS = 0.35  # standard deviation of a group's middle, share of its radius
PUSH_MS2 = 1.5  # of accelerations: walkers turn, cars brake
FASTEST_MS = 15.0  # standard deviation of the speed of a new object, and bound of its gate
GATE_SIGMAS, LEAST_GATE_M = 3.0, 0.6
LOST_NS = 600_000_000  # without a group
SURE_HITS, SURE_NS = 3, 150_000_000  # groups and age from which a track is moving or standing
LEAST_MS = 0.4  # slower is standing: a tree in the wind, or noise
SURE_SIGMAS = 1.6  # of the speed
LEAST_RADIUS_M = 0.2
WAY_M = 0.25  # and half of its radius, from where it was first seen

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MovingObject:
    """Object that moves over the ground.

    number: of its track. enu_m, velocity_ms: (2,) east and north at `stamp_ns`. radius_m, height_m: of its
    returns around their middle, and over the ground. ground_m: of the ground below it, up in the map frame.
    """

    number: int
    stamp_ns: int
    enu_m: Floats
    velocity_ms: Floats
    radius_m: float
    height_m: float
    ground_m: float = math.nan

    def at(self, stamp_ns: int) -> Floats:
        """Return its predicted place (2,)."""
        place: Floats = self.enu_m + self.velocity_ms * ((stamp_ns - self.stamp_ns) * 1e-9)
        return place

    def nearest(self, enu_m: Floats, from_ns: int, until_ns: int) -> tuple[float, int]:
        """Return its least distance from a place (2,) within a time, by its velocity, and when that is."""
        start, way_s = self.at(from_ns) - enu_m, (until_ns - from_ns) * 1e-9
        speed2 = float(self.velocity_ms @ self.velocity_ms)
        after_s = 0.0 if speed2 == 0 else min(max(-float(start @ self.velocity_ms) / speed2, 0.0), way_s)
        place = start + after_s * self.velocity_ms
        return float(np.hypot(*place)), from_ns + round(after_s * 1e9)


@dataclass(slots=True)
class _Track:
    number: int
    stamp_ns: int
    state: Floats  # east, north, and their rates
    covariance: Floats
    first_enu_m: Floats
    first_ns: int
    radius_m: float
    height_m: float
    ground_m: float
    hits: int = 1
    seen_ns: int = 0
    moves: bool = False  # by its last group

    def predict(self, stamp_ns: int) -> None:
        """Move to a time."""
        dt = (stamp_ns - self.stamp_ns) * 1e-9
        move = np.eye(4)
        move[0, 2] = move[1, 3] = dt
        push = PUSH_MS2**2 * np.array([[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]])
        self.state = move @ self.state
        self.covariance = move @ self.covariance @ move.T + np.kron(push, np.eye(2))
        self.stamp_ns = stamp_ns

    def update(self, group: Group) -> None:
        """Take a group as a measurement of the place where the object was at its stamp."""
        late_s = (self.stamp_ns - group.stamp_ns) * 1e-9
        seen = np.hstack([np.eye(2), -late_s * np.eye(2)])
        spread = seen @ self.covariance @ seen.T + _place_noise_m(group) ** 2 * np.eye(2)
        gain = self.covariance @ seen.T @ np.linalg.inv(spread)
        self.state = self.state + gain @ (group.enu_m - seen @ self.state)
        self.covariance = self.covariance - gain @ seen @ self.covariance
        trace_m = float(np.hypot(*self.state[2:])) * group.span_s / 2
        self.radius_m = max(group.radius_m - trace_m, 0.8 * self.radius_m, LEAST_RADIUS_M)
        self.height_m = max(group.height_m, 0.9 * self.height_m)
        self.ground_m = group.ground_m
        self.hits += 1
        self.seen_ns = group.stamp_ns
        self.moves = self._seems_to_move()

    def _seems_to_move(self) -> bool:
        speed = float(np.hypot(*self.state[2:]))
        unsure = math.sqrt(max(0.0, float(np.linalg.eigvalsh(self.covariance[2:, 2:])[-1])))
        way_m = float(np.hypot(*(self.state[:2] - self.first_enu_m)))
        is_old = self.hits >= SURE_HITS and self.seen_ns - self.first_ns >= SURE_NS
        return is_old and speed > max(LEAST_MS, SURE_SIGMAS * unsure) and way_m > WAY_M + self.radius_m / 2

    def object(self) -> MovingObject:
        """Return what is known of it now."""
        return MovingObject(
            self.number,
            self.stamp_ns,
            self.state[:2].copy(),
            self.state[2:].copy(),
            self.radius_m,
            self.height_m,
            self.ground_m,
        )


class Tracks:
    """Tracks of all objects around the vehicle."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._numbers = itertools.count(1)

    def forget(self) -> None:
        """Drop all tracks: a new map begins."""
        self._tracks.clear()

    def update(self, found: list[Group], now_ns: int) -> tuple[MovingObject, ...]:
        """Follow the groups of a moment; return the objects that move."""
        self._tracks = [t for t in self._tracks if 0 <= now_ns - t.seen_ns <= LOST_NS]
        for track in self._tracks:
            track.predict(max(now_ns, track.stamp_ns))
        new = set(range(len(found)))
        for track, at in self._assigned(found):
            track.update(found[at])
            new.discard(at)
        for at in sorted(new):
            self._begin(found[at], now_ns)
        return tuple(track.object() for track in self._tracks if track.moves)

    def _assigned(self, found: list[Group]) -> list[tuple[_Track, int]]:
        if not found or not self._tracks:
            return []
        places = np.array([group.enu_m for group in found])
        away = np.array([np.hypot(*(places - track.state[:2]).T) for track in self._tracks])
        gates = np.array([_gate_m(track) for track in self._tracks])[:, None]
        gates = gates + np.array([group.radius_m for group in found])[None, :] / 2
        costs = np.where(away <= gates, away, 1e6)
        rows, cols = linear_sum_assignment(costs)
        return [
            (self._tracks[r], int(c)) for r, c in zip(rows, cols, strict=True) if away[r, c] <= gates[r, c]
        ]

    def _begin(self, group: Group, now_ns: int) -> None:
        covariance = np.diag([PLACE_M[1] ** 2] * 2 + [FASTEST_MS**2 / 9] * 2)
        state = np.array([*group.enu_m, 0.0, 0.0])
        self._tracks.append(
            _Track(
                next(self._numbers), now_ns, state, covariance, group.enu_m.copy(), group.stamp_ns,
                group.radius_m, group.height_m, group.ground_m, seen_ns=group.stamp_ns,
            )
        )  # fmt: skip


def _gate_m(track: _Track) -> float:
    spread = math.sqrt(float(np.linalg.eigvalsh(track.covariance[:2, :2])[-1]) + PLACE_M[1] ** 2)
    return min(max(LEAST_GATE_M, GATE_SIGMAS * spread), LEAST_GATE_M + FASTEST_MS / 5)


def _place_noise_m(group: Group) -> float:
    return float(np.clip(OF_RADIUS * group.radius_m, *PLACE_M))
