"""Specks: returns of airborne particles (dust, rain, snow, insects), recognised by each scan's rays.

A wire or wall returns again at the same place; a speck does not. A return is judged by the rays of its own
scan and of those before and after it that passed through a ball around it: it is a speck as soon as the
thinnest wire would have returned three times or more, and nothing did but what the air before the ball
explains. Until then it is undecided: it may be ground or a thin object for the map, which judges again, and
an obstacle only once another ray ends there, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame, is_known
from slz.kernels.points.ray_image import HITS, fill_image, first_cells
from slz.kernels.points.speck_likelihood import LEAST_BALL_M, MOST_BALL_M, SHELLS, SLOTS, judge, judge_again
from slz.kernels.points.speck_likelihood import OBJECT as _OBJECT
from slz.kernels.points.speck_likelihood import SPECK as _SPECK
from slz.kernels.points.speck_likelihood import UNDECIDED as _UNDECIDED
from slz.window import Scan

KEPT_NS = 2_500_000_000  # scans whose rays judge a return, before it and after
CERTAIN_NS = 1_000_000_000  # in which a place with an object is not judged again
SCANS = 64  # that are kept, at the most
MOST_RAYS = 1 << 14  # of a scan; more are thinned
REACH_M = 25.0  # specks are nearer: snow returns up to 20 or 25 m, dust and rain mostly within 10
BRIGHT, BRIGHT_BONUS = 0.3, 1.0  # of a white target: few drops or grains send back as much
SPREAD, MOST_SPREAD = 0.06, 0.12  # radius of the ball around a return, as a share of its range
SPREAD_AT_HZ = 200_000  # pulses per second at which it is the least
WIRE_M = 0.01  # thinnest object that must not be taken for a speck, in proportion to the ball's share
MOST_WAITING = 4096  # undecided returns that are judged again

Floats = NDArray[np.float64]


class ReturnKind(IntEnum):
    """Source of a return."""

    OBJECT = _OBJECT
    UNDECIDED = _UNDECIDED
    """Alone, and too few rays passed to say that no wire is there; see `SpeckDetector.seen_again`."""
    SPECK = _SPECK


@dataclass(frozen=True, slots=True)
class _Waiting:
    """Undecided returns: points (n, 3), stamps, intensity's share, ranges (n,), and counts of rays (n, 3)."""

    points: Floats
    stamp_ns: NDArray[np.int64]
    bonus: Floats
    away_m: Floats
    radius_m: Floats
    counts: Floats

    @classmethod
    def none(cls) -> _Waiting:
        return cls(
            np.empty((0, 3)), np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0), np.empty((0, 3))
        )

    def some(self, which: NDArray[np.bool_]) -> _Waiting:
        return _Waiting(*(getattr(self, name)[which] for name in self.__slots__))

    def newest_with(self, other: _Waiting) -> _Waiting:
        """Return the last `MOST_WAITING` of these returns and others."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__slots__)
        return _Waiting(*(np.concatenate(pair)[-MOST_WAITING:] for pair in pairs))


class SpeckDetector:
    """Judge of each return.

    Attributes
    ----------
    specks
        Returns judged to be specks so far.
    """

    def __init__(self) -> None:
        self._first = first_cells()
        cells = int(self._first[-1])
        self._rays = np.empty((SCANS, 4, MOST_RAYS), np.float32)  # untouched pages cost nothing
        self._weights, self._clutter = np.empty((2, SCANS, MOST_RAYS), np.int32)
        self._starts = np.zeros((SCANS, cells + 1), np.int32)
        self._sensors = np.zeros((SCANS, 3))
        self._stamps = np.zeros(SCANS, np.int64)
        self._certain = np.zeros((SLOTS, 2), np.int64)
        self._air = np.zeros((SHELLS, 2))
        self._rays_hz, self._spread = float(SPREAD_AT_HZ), SPREAD
        self._next = self._stored = 0
        self._frame: LocalFrame | None = None
        self._waiting = _Waiting.none()
        self.specks = 0

    @property
    def seen_again(self) -> tuple[Floats, NDArray[np.int64]]:
        """Undecided returns (n, 3) of the last seconds beside which another ray ended, and their stamps."""
        again = self._waiting.counts[:, HITS] > 0
        return self._waiting.points[again], self._waiting.stamp_ns[again]

    def forget(self) -> None:
        """Drop all rays and undecided returns: the position estimate moved."""
        self._next = self._stored = 0
        self._certain[:], self._air[:] = 0, 0.0
        self._waiting = _Waiting.none()

    def classify(self, scan: Scan) -> NDArray[np.uint8]:
        """Return the `ReturnKind` of each return of a scan (n,), the newest one of its sensor.

        The result does not depend on the order of the returns within the scan. Where the sensor's position is
        unknown, all are objects.
        """
        kinds = np.zeros(len(scan), np.uint8)
        if not len(scan) or not is_known(scan.sensor_enu_m):
            return kinds
        now_ns = int(scan.stamp_ns[-1])
        self._follow(scan, now_ns)
        at, slots = self._store(scan, now_ns)
        self._judge_waiting(at, now_ns)
        bonus, counts = _bonus(scan), np.zeros((len(scan), 3))
        judge(
            scan.points_enu_m, bonus, self._spread, self._wire_m, REACH_M, at, self._stored, self._sensors,
            self._first, self._rays, self._weights, self._starts, slots, self._clutter, self._air,
            self._certain, now_ns, CERTAIN_NS, kinds, counts,
        )  # fmt: skip
        self._keep_undecided(scan, kinds, bonus, counts)
        self.specks += int(np.count_nonzero(kinds == ReturnKind.SPECK))
        return kinds

    def _follow(self, scan: Scan, now_ns: int) -> None:
        """Begin anew in another frame, or when the clock went back; drop scans that are too old."""
        newest = self._stamps[self._next - 1]
        if scan.frame != self._frame or (self._stored and now_ns < newest):
            self.forget()
            self._frame = scan.frame
        while self._stored and now_ns - int(self._stamps[(self._next - self._stored) % SCANS]) > KEPT_NS:
            self._stored -= 1

    def _store(self, scan: Scan, now_ns: int) -> tuple[int, NDArray[np.int32]]:
        """Store a scan's rays; return its number, and where the ray of each return is stored."""
        at, slots = self._next, np.empty(len(scan), np.int32)
        ends = np.empty((0, 3)) if scan.open_enu_m is None else scan.open_enu_m
        half = MOST_RAYS // 2
        every, open_every = (max(1, math.ceil(len(points) / half)) for points in (scan.points_enu_m, ends))
        self._sensors[at] = scan.sensor_enu_m
        fill_image(
            scan.points_enu_m, every, ends, open_every, round(scan.open_weight), self._sensors[at],
            self._first, self._rays[at], self._weights[at], self._starts[at], slots,
        )  # fmt: skip
        n = int(self._starts[at, -1])
        self._measure_rate(float(self._weights[at, :n].sum()), now_ns)
        self._clutter[at, :n] = self._weights[at, :n]
        self._stamps[at], self._next = now_ns, (at + 1) % SCANS
        self._stored = min(SCANS, self._stored + 1)
        return at, slots

    @property
    def _wire_m(self) -> float:
        """Diameter of the thinnest wire to keep: a slow sensor shows thicker ones only."""
        return WIRE_M * self._spread / SPREAD

    def _measure_rate(self, rays: float, now_ns: int) -> None:
        """Follow the sensor's rate: a ball must hold rays enough, and no more than needed."""
        if not self._stored:
            return
        pause_s = (now_ns - int(self._stamps[self._next - 1])) * 1e-9
        if pause_s > 0:
            self._rays_hz += 0.1 * (rays / pause_s - self._rays_hz)
            spread = SPREAD * math.sqrt(SPREAD_AT_HZ / max(self._rays_hz, 1.0))
            self._spread = min(MOST_SPREAD, max(SPREAD, spread))

    def _judge_waiting(self, at: int, now_ns: int) -> None:
        waiting = self._waiting.some(now_ns - self._waiting.stamp_ns <= KEPT_NS)
        verdicts = np.empty(len(waiting.points), np.uint8)
        judge_again(
            waiting.points, waiting.bonus, waiting.away_m, waiting.radius_m, self._wire_m, self._sensors[at],
            self._first, self._rays[at], self._weights[at], self._clutter[at], self._starts[at], self._air,
            waiting.counts, verdicts,
        )  # fmt: skip
        self._waiting = waiting.some(verdicts != ReturnKind.SPECK)

    def _keep_undecided(self, scan: Scan, kinds: NDArray[np.uint8], bonus: Floats, counts: Floats) -> None:
        which = kinds == ReturnKind.UNDECIDED
        if not which.any():
            return
        points = scan.points_enu_m[which]
        away = np.linalg.norm(points - scan.sensor_enu_m, axis=1)
        radius = np.clip(self._spread * away, LEAST_BALL_M, MOST_BALL_M)
        new = _Waiting(points, scan.stamp_ns[which], bonus[which], away, radius, counts[which])
        self._waiting = self._waiting.newest_with(new)


def without_specks(scan: Scan) -> Scan:
    """Return a judged scan without its specks, and any other as it is."""
    if scan.kinds is None or not (scan.kinds == ReturnKind.SPECK).any():
        return scan
    return scan.select(scan.kinds != ReturnKind.SPECK)


def only_objects(scan: Scan) -> Scan:
    """Return the objects' returns of a judged scan, and any other scan as it is."""
    if scan.kinds is None or (scan.kinds == ReturnKind.OBJECT).all():
        return scan
    return scan.select(scan.kinds == ReturnKind.OBJECT)


def _bonus(scan: Scan) -> Floats:
    """Return what intensity adds to the log-odds of an object: a bright return is hardly a speck."""
    if scan.attributes is None:
        return np.zeros(len(scan))
    return np.where(scan.attributes.intensity >= BRIGHT, BRIGHT_BONUS, 0.0)  # False for NaN
