"""Departure of the vehicle from the velocities asked of it, however slow.

A vehicle that obeys flies at least a third of a velocity asked in the last second, or comes nearer to that
by a small acceleration. A reference follows it, and goes on by itself when the vehicle does not. The error
that the vehicle has and the reference has not is integrated to a departure, which fades: a gust leaves
nothing, a slow sink or a standstill adds up.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from companion.flight.landing.situation import Situation, Vector

SHARE = 1 / 3  # of the velocity asked: the autopilot may have a limit of its own
ACCELERATION_MS2 = 0.5  # of the reference: a vehicle of 1 m/s2 half a second late, in turns of 90 degrees
MOST_MS = 1.0, 0.5  # greatest rate at which a departure grows, horizontal and vertical
LIMIT_M = 3.0, 1.5  # departure of a vehicle that does not obey: three seconds at those rates
KEPT = 1.2  # times the limit, beyond which a departure does not grow: it is over soon once the vehicle obeys
FADES_S = 20.0
LONGEST_STEP_NS = 500_000_000
LAG_NS, SAMPLE_NS = 1_000_000_000, 200_000_000  # of link and vehicle; between two velocities that are kept
LEVEL, UP = slice(0, 2), slice(2, 3)


class VelocityFollowing:
    """Departure of the vehicle from the velocities asked, east, north, up (m)."""

    def __init__(self) -> None:
        self._reference_ms: Vector | None = None
        self._departure_m = np.zeros(3)
        self._asked: deque[tuple[int, Vector]] = deque()  # time and velocity of the last second
        self._last_ns = 0
        self._epoch = 0

    def restart(self) -> None:
        """Forget the departure: the vehicle was commanded otherwise, or another reaction has begun."""
        self._reference_ms = None
        self._departure_m = np.zeros(3)
        self._asked.clear()

    def update(self, s: Situation) -> None:
        """Follow the vehicle by one step; `s.asked_enu_ms` is the velocity that was sent last."""
        velocity, asked, reference = s.velocity_enu_ms, s.asked_enu_ms, self._reference_ms
        step_ns, self._last_ns = s.now_ns - self._last_ns, s.now_ns
        if velocity is None or asked is None or not (s.guided and s.heard) or s.epoch != self._epoch:
            self._epoch = s.epoch
            self.restart()
        elif reference is None or step_ns > LONGEST_STEP_NS:
            self.restart()
            self._reference_ms = velocity.copy()
        else:
            recent = np.array([asked, *(one for _, one in self._asked)])
            for axes, most_ms, limit_m in zip((LEVEL, UP), MOST_MS, LIMIT_M, strict=True):
                step_s = step_ns * 1e-9
                outside = _follow(reference[axes], velocity[axes], recent[:, axes], step_s)
                faded = self._departure_m[axes] * math.exp(-step_s / FADES_S)
                grown = faded + step_s * _limited(outside, most_ms)
                self._departure_m[axes] = _limited(grown, KEPT * limit_m)
            self._remember(asked, s.now_ns)

    def _remember(self, asked: Vector, now_ns: int) -> None:
        if not self._asked or now_ns - self._asked[-1][0] >= SAMPLE_NS:
            self._asked.append((now_ns, asked))
        while now_ns - self._asked[0][0] > LAG_NS:
            self._asked.popleft()

    @property
    def sinks(self) -> bool:
        """True if the vehicle is far below the heights asked: it sinks, or does not climb."""
        return float(self._departure_m[2]) < -LIMIT_M[1]

    @property
    def departs(self) -> bool:
        """True if the vehicle is far beside, ahead of, behind or above the way asked."""
        return math.hypot(*self._departure_m[LEVEL]) > LIMIT_M[0] or float(self._departure_m[2]) > LIMIT_M[1]


def _follow(reference: Vector, velocity: Vector, recent: Vector, step_s: float) -> Vector:
    """Move the reference, and return the error of a velocity that neither lag nor acceleration explains.

    recent: velocities asked, (n, k), the newest first.
    """
    asked = recent[:1]
    reference += _limited(-_error(reference, asked), ACCELERATION_MS2 * step_s)
    error, late_error = _error(velocity, asked), _error(velocity, recent)
    missing, allowed = _length(error), _length(_error(reference, asked))
    if missing <= allowed:
        reference[:] = velocity
        return np.zeros_like(error)
    slow_error = error * (1 - allowed / missing)
    return np.asarray(min(slow_error, late_error, key=_length))


def _error(velocity: Vector, asked: Vector) -> Vector:
    """Return the offset of a velocity from the nearest that obeys: a third to all of one asked, (n, k)."""
    errors = [velocity - _share(velocity, one) * one for one in asked]
    return np.asarray(min(errors, key=_length))


def _share(velocity: Vector, asked: Vector) -> float:
    squared = float(asked @ asked)
    return 1.0 if squared == 0 else min(1.0, max(SHARE, float(velocity @ asked) / squared))


def _length(vector: Vector) -> float:
    return math.sqrt(float(vector @ vector))


def _limited(vector: Vector, longest: float) -> Vector:
    length = _length(vector)
    return vector if length <= longest else np.asarray(vector * (longest / length))
