"""Where the vehicle was, and how it was turned, at any moment of the last seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.outputs.axes import rotation_enu_from_frd
from params import Parameters
from slz import LocalFrame

Floats = NDArray[np.float64]

CAPACITY = 2048
JUMP_M = 2.0
EXTRAPOLATION_NS = 200_000_000


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose at a time of the companion clock; quat_wxyz turns body forward-right-down into north-east-down."""

    stamp_ns: int
    position_enu_m: Floats
    velocity_enu_ms: Floats
    quat_wxyz: Floats
    rotation_enu_from_frd: Floats


class _Track:
    """Ring of stamped rows in order of time."""

    def __init__(self, width: int) -> None:
        self.stamps = np.zeros(2 * CAPACITY, np.int64)
        self.rows = np.zeros((2 * CAPACITY, width))
        self.end = 0
        self.start = 0

    def add(self, stamp_ns: int, row: Floats) -> bool:
        """Append a row; refuse one that is not newer than the last."""
        if self.end > self.start and stamp_ns <= self.stamps[self.end - 1]:
            return False
        if self.end == len(self.stamps):
            keep = slice(self.end - CAPACITY, self.end)
            self.stamps[:CAPACITY], self.rows[:CAPACITY] = self.stamps[keep].copy(), self.rows[keep].copy()
            self.start, self.end = 0, CAPACITY
        self.stamps[self.end], self.rows[self.end] = stamp_ns, row
        self.end += 1
        self.start = max(self.start, self.end - CAPACITY)
        return True

    def clear(self) -> None:
        self.start = self.end = 0

    @property
    def newest_ns(self) -> int | None:
        return int(self.stamps[self.end - 1]) if self.end > self.start else None

    @property
    def view(self) -> tuple[NDArray[np.int64], Floats]:
        return self.stamps[self.start : self.end], self.rows[self.start : self.end]


class PoseHistory:
    """Attitudes and positions by their own stamps.

    The first position fixes the map frame. A stamp that goes back is refused and counted; one that goes back
    by more than a second means that the clocks were set anew, and the history starts again. A position that
    jumps against the velocity also starts it again and counts in `jumps`: scans that straddle one must be
    dropped.
    """

    def __init__(self, parameters: Parameters, frame: LocalFrame | None = None) -> None:
        self.frame = frame
        self.refused = 0
        self.jumps = 0
        self._gap_ns = round(parameters.pose_timeout_s * 1e9)
        self._attitudes = _Track(7)  # quaternion, rates
        self._positions = _Track(6)  # position, velocity, map frame

    def add_attitude(
        self, stamp_ns: int, quat_wxyz: tuple[float, ...] | Floats, rates_rad_s: tuple[float, ...] | Floats
    ) -> None:
        """Take an attitude (body FRD to NED) and body rates."""
        quat = np.asarray(quat_wxyz, np.float64)
        norm = float(np.sqrt(quat @ quat))
        if not 0.9 < norm < 1.1:
            self.refused += 1
            return
        self._add(self._attitudes, stamp_ns, np.concatenate([quat / norm, np.asarray(rates_rad_s)]))

    def add_position(
        self, stamp_ns: int, lat_deg: float, lon_deg: float, alt_m: float, velocity_ned_ms: tuple[float, ...]
    ) -> None:
        """Take a position above mean sea level and a velocity."""
        if self.frame is None:
            self.frame = LocalFrame(lat_deg, lon_deg, alt_m)
        north, east, down = velocity_ned_ms
        row = np.concatenate([self.frame.enu_m(lat_deg, lon_deg, alt_m), [east, north, -down]])
        if not np.isfinite(row).all():
            self.refused += 1
            return
        stamps, rows = self._positions.view
        if len(stamps):
            dt = (stamp_ns - int(stamps[-1])) * 1e-9
            moved = rows[-1, :3] + 0.5 * (rows[-1, 3:] + row[3:]) * dt
            if 0 < dt < 2.0 and float(np.abs(row[:3] - moved).max()) > JUMP_M:
                self.jumps += 1
                self._positions.clear()
        self._add(self._positions, stamp_ns, row)

    def _add(self, track: _Track, stamp_ns: int, row: Floats) -> None:
        newest = track.newest_ns
        if newest is not None and stamp_ns < newest - 1_000_000_000:
            self._attitudes.clear()
            self._positions.clear()
        if not track.add(stamp_ns, row):
            self.refused += 1

    @property
    def bracketed_until_ns(self) -> int | None:
        """Newest time that both attitudes and positions cover."""
        a, p = self._attitudes.newest_ns, self._positions.newest_ns
        return None if a is None or p is None else min(a, p)

    def interpolate(self, stamps_ns: NDArray[np.int64]) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Return positions (n, 3) in the map, quaternions (n, 4) body to NED, and which are valid.

        Positions follow a cubic through positions and velocities, attitudes a spherical line. Invalid are
        times outside the history or inside a gap longer than `pose_timeout_s`.
        """
        n = len(stamps_ns)
        (ta, qa), (tp, xp) = self._attitudes.view, self._positions.view
        if len(ta) < 2 or len(tp) < 2:
            return np.zeros((n, 3)), np.tile([1.0, 0, 0, 0], (n, 1)), np.zeros(n, bool)
        i, f, ok_a = self._places(ta, stamps_ns)
        quats = slerp(qa[i, :4], qa[i + 1, :4], f)
        i, f, ok_p = self._places(tp, stamps_ns)
        dt = ((tp[i + 1] - tp[i]) * 1e-9)[:, None]
        positions = _hermite(xp[i, :3], xp[i, 3:] * dt, xp[i + 1, :3], xp[i + 1, 3:] * dt, f[:, None])
        return positions, quats, ok_a & ok_p

    def _places(
        self, times: NDArray[np.int64], stamps: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Floats, NDArray[np.bool_]]:
        i = np.clip(np.searchsorted(times, stamps, side="right") - 1, 0, len(times) - 2)
        span = times[i + 1] - times[i]
        f = (stamps - times[i]) / span
        return i, np.clip(f, 0.0, 1.0), (f >= 0) & (f <= 1) & (span <= self._gap_ns)

    def latest(self, now_ns: int) -> Pose | None:
        """Return the pose now, carried on from the newest by velocity and rates; None if that is stale."""
        (ta, qa), (tp, xp) = self._attitudes.view, self._positions.view
        if not len(ta) or not len(tp):
            return None
        age_a, age_p = now_ns - int(ta[-1]), now_ns - int(tp[-1])
        if max(age_a, age_p) > self._gap_ns:
            return None
        quat = _turned(qa[-1, :4], qa[-1, 4:], min(max(age_a, 0), EXTRAPOLATION_NS) * 1e-9)
        velocity = xp[-1, 3:].copy()
        position = xp[-1, :3] + velocity * min(max(age_p, 0), EXTRAPOLATION_NS) * 1e-9
        stamp = min(int(ta[-1]), int(tp[-1]))
        return Pose(stamp, position, velocity, quat, rotation_enu_from_frd(quat))


def slerp(a: Floats, b: Floats, f: Floats) -> Floats:
    """Return unit quaternions (n, 4) at fractions f (n,) of the short way from a to b."""
    dot = np.einsum("ij,ij->i", a, b)
    b = np.where(dot[:, None] < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    small = sine < 1e-6
    safe = np.where(small, 1.0, sine)
    wa = np.where(small, 1 - f, np.sin((1 - f) * angle) / safe)
    wb = np.where(small, f, np.sin(f * angle) / safe)
    out = wa[:, None] * a + wb[:, None] * b
    return np.asarray(out / np.sqrt(np.einsum("ij,ij->i", out, out))[:, None])


def _hermite(a: Floats, va: Floats, b: Floats, vb: Floats, f: Floats) -> Floats:
    f2, f3 = f * f, f * f * f
    return (2 * f3 - 3 * f2 + 1) * a + (f3 - 2 * f2 + f) * va + (3 * f2 - 2 * f3) * b + (f3 - f2) * vb


def _turned(quat: Floats, rates: Floats, dt_s: float) -> Floats:
    """Turn a quaternion by body rates for dt."""
    w, x, y, z = quat
    p, q, r = rates * (0.5 * dt_s)
    out = np.array(
        [
            w - x * p - y * q - z * r,
            x + w * p + y * r - z * q,
            y + w * q + z * p - x * r,
            z + w * r + x * q - y * p,
        ]
    )
    return np.asarray(out / np.sqrt(out @ out))
