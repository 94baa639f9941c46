"""Worlds in closed form and their returns: catenaries, ground, and what is no wire."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import params
from slz.air.seen_air import SeenAir
from slz.wires.detected_wire import Wire
from slz.wires.wire_detector import WireDetector

Floats = NDArray[np.float64]
RANGE_NOISE_M, ANGLE_NOISE_RAD = 0.02, math.radians(0.15)
PLACE_NOISE_M, TURN_NOISE_RAD = 0.03, math.radians(0.1)  # of the vehicle in a window
HALF_M = 30.0
Body = Callable[[np.random.Generator, Floats], Floats]
"""Returns of a window from the sensor's position."""


@dataclass(frozen=True)
class Rectangle:
    """Opaque rectangle at a coordinate of one axis, from corner to corner (3,)."""

    axis: int
    at_m: float
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]

    def is_between(self, sensor: Floats, points: Floats) -> NDArray[np.bool_]:
        """Whether the rays to points (n, 3) meet it."""
        way = points - sensor
        share = (self.at_m - sensor[self.axis]) / way[:, self.axis]
        met = sensor + way * share[:, np.newaxis]
        others = [k for k in range(3) if k != self.axis]
        inside = ((met >= self.low_m) & (met <= self.high_m))[:, others].all(axis=1)
        return np.asarray(inside & (share > 0) & (share < 1))


@dataclass(frozen=True)
class Catenary:
    """Wire between two points (3,) that sags in the middle."""

    start_m: Floats
    stop_m: Floats
    sag_m: float

    def points(self, share: Floats) -> Floats:
        """Points (n, 3) at shares of the distance over ground: z = h cosh((x - x0) / h) + k."""
        level_m = float(np.hypot(*(self.stop_m - self.start_m)[:2]))
        half, rise = level_m / 2, float(self.stop_m[2] - self.start_m[2])
        low, high = 1.0, 1e7
        for _ in range(200):  # h such that a level span sags so much
            h = math.sqrt(low * high)
            low, high = (low, h) if h * (math.cosh(min(700.0, half / h)) - 1) < self.sag_m else (h, high)
        lowest = half - h * math.asinh(rise / (2 * h * math.sinh(half / h)))
        x = share * level_m
        up = h * (np.cosh((x - lowest) / h) - math.cosh(lowest / h)) + self.start_m[2]
        level = self.start_m[:2] + share[:, np.newaxis] * (self.stop_m - self.start_m)[:2]
        return np.column_stack([level, up])

    def height_at(self, enu_m: Floats) -> Floats:
        """Heights over places (n, 2)."""
        way = (self.stop_m - self.start_m)[:2]
        share = (enu_m[:, :2] - self.start_m[:2]) @ way / (way @ way)
        return self.points(share)[:, 2]

    def aside_m(self, enu_m: Floats) -> Floats:
        """Distances (n,) of places from the plane of the wire."""
        way = (self.stop_m - self.start_m)[:2] / np.hypot(*(self.stop_m - self.start_m)[:2])
        off = enu_m[:, :2] - self.start_m[:2]
        return np.abs(off @ np.array([-way[1], way[0]]))


def wire(line: Catenary, per_m: float, reach_m: float = 40.0, nominal_m: float = 25.0) -> Body:
    """Return returns of a wire: `per_m` in a metre and a window at 25 m, and more when it is nearer."""

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        share = rng.random(20_000)
        length_m = float(np.linalg.norm(line.stop_m - line.start_m))
        points = line.points(share)
        ranges = np.linalg.norm(points - sensor, axis=1)
        rate = per_m * length_m / len(share) * (nominal_m / ranges)
        return points[(rng.random(len(share)) < rate) & (ranges < reach_m)]

    return returns


def ground(per_m2: float, hidden_by: Rectangle | None = None, half_m: float = HALF_M) -> Body:
    """Return returns of level ground around the vehicle, but for what a rectangle hides."""

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        level = rng.uniform(-half_m, half_m, (round(per_m2 * (2 * half_m) ** 2), 2)) + sensor[:2]
        points = np.column_stack([level, np.zeros(len(level))])
        return points if hidden_by is None else points[~hidden_by.is_between(sensor, points)]

    return returns


def box(low_m: Sequence[float], high_m: Sequence[float], per_window: int) -> Body:
    """Return returns all over a box: leaves, dust, or with a side of no length a wall or a roof."""

    def returns(rng: np.random.Generator, sensor: Floats) -> Floats:
        return rng.uniform(low_m, high_m, (rng.poisson(per_window), 3))

    return returns


def all_of(bodies: Sequence[Body]) -> Body:
    """Return the returns of several bodies."""
    return lambda rng, sensor: np.concatenate([np.empty((0, 3)), *(body(rng, sensor) for body in bodies)])


def seen(bodies: Sequence[Body], sensor: Floats, rng: np.random.Generator) -> Floats:
    """Returns of a window, with noise of rays and of the pose."""
    points = np.concatenate([body(rng, sensor) for body in bodies])
    way = points - sensor
    ranges = np.linalg.norm(way, axis=1, keepdims=True)
    turn = rng.normal(0, TURN_NOISE_RAD, 3)
    off = way / ranges * rng.normal(0, RANGE_NOISE_M, (len(points), 1))
    off += ranges * rng.normal(0, ANGLE_NOISE_RAD, (len(points), 3)) + np.cross(turn, way)
    return np.asarray(points + off + rng.normal(0, PLACE_NOISE_M, 3))


def watch(
    bodies: Sequence[Body],
    sensors: Sequence[Floats],
    seed: int = 1,
    moved: Callable[[Floats], Floats] | None = None,
) -> tuple[WireDetector, list[tuple[Wire, ...]]]:
    """Return a detector after windows from the sensor's positions, and the wires known after each."""
    rng = np.random.default_rng(seed)
    parameters, known = params.load("quadcopter", []), []
    air = SeenAir(parameters)
    detector = WireDetector(parameters, air)
    for k, sensor in enumerate(sensors):
        points = seen(bodies, sensor, rng)
        if moved is not None:
            points, sensor = moved(points), moved(sensor[np.newaxis])[0]
        air.add(points, np.zeros(len(points), np.uint16), sensor[np.newaxis], 0.0)
        detector.update(points, sensor, float(k), k * 1_000_000_000)
        known.append(detector.wires(0.0))
    return detector, known


def approach(start_m: Sequence[float], stop_m: Sequence[float], windows: int) -> list[Floats]:
    """Positions of the sensor on a straight way."""
    return [np.asarray(start_m) + k / (windows - 1) * (np.asarray(stop_m) - start_m) for k in range(windows)]
