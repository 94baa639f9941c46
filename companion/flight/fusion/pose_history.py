"""History of the vehicle's attitude and position, with interpolation at any time between samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.attitude_steps import AttitudeSteps
from companion.flight.fusion.motion import POSITION_WIDTH, STRETCH, interpolate
from companion.flight.fusion.odometry.correction import Correction
from companion.flight.geometry.axes import quaternion_wxyz
from companion.flight.geometry.pose import Pose, turned
from companion.runtime.ring_buffer import SampleBuffer
from params import Parameters
from slz.frame import LocalFrame

Floats = NDArray[np.float64]

CAPACITY = 1024
# A position this far from the prediction by the velocities is a correction of the estimate, not motion. The
# allowance also covers unknown accelerations: over a gap, an acceleration a adds at most a t^2 / 4 to the
# prediction by the mean velocity of both ends, half of that if it changes once.
JUMP_M = 2.0
ACCELERATION_MS2 = 10.0
GAP_ACCELERATION_MS2 = 3.0
EXTRAPOLATION_S = 0.1
# Attitudes refer to the axes at the vehicle, the map's axes to its origin. Rotated by this angle, level
# ground has that slope and a return at 100 m is misplaced by 3.5 cm: 2.2 km north or south of the origin,
# 1.5 km east or west of it at 47 degrees of latitude.
MOST_TURN_RAD = math.radians(0.02)


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses at many stamps; invalid rows hold NaN.

    position_enu_m : (n, 3). rotation_enu_from_frd : (n, 3, 3). valid : (n,) bool.
    """

    position_enu_m: Floats
    rotation_enu_from_frd: Floats
    valid: NDArray[np.bool_]


class PoseHistory:
    """Buffers of the autopilot's attitude and position, on the companion clock.

    What is stored and interpolated is the autopilot's estimate; `latest` is relative to the map, by the
    odometry's `correction`.

    Parameters
    ----------
    parameters
        `pose_timeout_s`: longest gap that is interpolated, and age at which a pose is stale.
    frame
        Map frame; if None, the first position becomes its origin. A jump of the estimate too far from the
        origin begins a new frame.
    capacity
        Number of samples kept of each kind.

    Attributes
    ----------
    frame
        Map frame, None until known.
    epoch
        Incremented when the position estimate jumps, the clocks restart or a new frame begins.
    correction
        From the autopilot's coordinates to those of the map.
    tracked_until_ns
        Time until which the odometry knows the place on the map, so that a jump of the estimate moves nothing
        on it; None while it does not.
    jumps, absorbed, refused, misdated
        Jumps of the estimate that began an epoch, and those of a reset height or while the odometry knows
        the place, which move nothing on the map; samples out of
        order, repeated or not finite; samples dropped because they were stamped by a wrong mapping of the
        autopilot's clock.
    steps
        Whether attitudes come often enough for the turns.
    """

    def __init__(
        self, parameters: Parameters, frame: LocalFrame | None = None, capacity: int = CAPACITY
    ) -> None:
        self._limit_ns = round(parameters.pose_timeout_s * 1e9)
        self._attitudes = SampleBuffer(4, capacity)
        self._positions = SampleBuffer(POSITION_WIDTH, capacity)
        self._rates = np.zeros(3)
        self.frame = frame
        self.epoch = 0
        self.jumps = self.absorbed = 0
        self.refused = 0
        self.steps = AttitudeSteps()
        self.correction = Correction()
        self.tracked_until_ns: int | None = None
        self._before_jump: tuple[int, Correction] | None = None  # last stamp before an absorbed jump
        self._newest_lla: tuple[float, float, float] | None = None
        self._latest: tuple[tuple[int, ...], Pose] | None = None  # for which time and samples, and the pose
        self.misdated = 0
        self._certain_ns: int | None = None
        self._trusts_all = True
        self._mappings = 0
        self._stretch = 0  # number of the interval between jumps of the estimate or the autopilot's clock

    def limit_to_certain(self, until_ns: int | None, mappings: int) -> None:
        """Limit the poses in use to stamps up to `until_ns`: later stamps may be wrong, see `AutopilotClock`.

        When `mappings` changes, samples after `until_ns` are dropped as wrongly stamped, and nothing is
        interpolated across the change.
        """
        self._certain_ns, self._trusts_all = until_ns, False
        if mappings == self._mappings:
            return
        self._mappings = mappings
        self._stretch += 1
        if until_ns is not None:
            self.misdated += self._attitudes.drop_after(until_ns) + self._positions.drop_after(until_ns)

    def add_attitude(self, stamp_ns: int, quat_wxyz: Sequence[float], rates: Sequence[float]) -> None:
        """Append an attitude (body forward-right-down to north-east-down) and body rates in rad/s."""
        quat = np.array(quat_wxyz, dtype=np.float64)
        norm = math.sqrt(quat.dot(quat))
        if not 0.5 < norm < 2 or not self._is_next(self._attitudes, stamp_ns):
            self.refused += 1
            return
        quat /= norm
        if self.steps.add(stamp_ns, quat, self._limit_ns):
            self._attitudes.clear()  # what was measured since the last one is not placed
        self._attitudes.append(stamp_ns, quat)
        self._rates = np.array([rate if math.isfinite(rate) else 0.0 for rate in rates])

    def add_position(
        self, stamp_ns: int, lat_deg: float, lon_deg: float, alt_m: float, vel_ned_ms: Sequence[float]
    ) -> None:
        """Append a position (WGS-84 degrees, altitude in m) and its rates north, east, down in m/s."""
        north_ms, east_ms, down_ms = vel_ned_ms
        velocity = np.array((east_ms, north_ms, -down_ms), dtype=np.float64)
        if not self._is_place(lat_deg, lon_deg, alt_m, velocity) or not self._is_next(
            self._positions, stamp_ns
        ):
            self.refused += 1
            return
        if self.frame is None:
            self.frame = LocalFrame(lat_deg, lon_deg, alt_m)
        position = self.frame.enu_m(lat_deg, lon_deg, alt_m)
        jump = self._jump_m(stamp_ns, position, velocity)
        is_tracked = self.tracked_until_ns is not None and stamp_ns <= self.tracked_until_ns
        if jump is not None and (is_tracked or self._is_of_height(jump, stamp_ns)):
            self._absorb(jump)
        elif jump is not None:
            self.jumps += 1
            self._begin_epoch()
            self._stretch += 1
            if self.frame.turn_rad(lat_deg, lon_deg) > MOST_TURN_RAD:
                self._change_frame(LocalFrame(lat_deg, lon_deg, alt_m))
                position = np.zeros(3)
        self._newest_lla = lat_deg, lon_deg, alt_m
        self._positions.append(stamp_ns, (*position, *velocity, self._stretch))

    @property
    def is_far(self) -> bool:
        """True if the vehicle is so far from the map's origin that a new frame should begin."""
        if self.frame is None or self._newest_lla is None:
            return False
        return self.frame.turn_rad(*self._newest_lla[:2]) > MOST_TURN_RAD

    def begin_frame(self, frame: LocalFrame | None = None) -> LocalFrame:
        """Begin a new map frame, at the newest position if none is given, and return it.

        Samples are converted to it; the epoch is incremented because the map is in the old frame.

        Raises
        ------
        ValueError
            No frame is given and there is no position.
        """
        if frame is None:
            if self._newest_lla is None:
                raise ValueError("a frame cannot begin without a position")
            frame = LocalFrame(*self._newest_lla)
        self._begin_epoch()
        self._change_frame(frame)
        return frame

    def _change_frame(self, frame: LocalFrame) -> None:
        """Convert stored positions to another frame; velocities keep the axes at the vehicle."""
        if self.frame is not None and len(self._positions):
            places = self._positions.values[:, :3]
            places[:] = frame.enu_m(*self.frame.lla(places).T)
        self.frame = frame

    def clear(self) -> None:
        """Drop all samples: the autopilot restarted, and so did its estimate."""
        self._attitudes.clear()
        self._positions.clear()
        self._begin_epoch()
        self._stretch += 1

    def correction_at(self, stamp_ns: int) -> Correction:
        """Return the correction of what was placed by poses of a time: another before an absorbed jump."""
        if self._before_jump is not None and stamp_ns <= self._before_jump[0]:
            return self._before_jump[1]
        return self.correction

    def _begin_epoch(self) -> None:
        """Begin an epoch: the map is of the coordinates before."""
        self.epoch += 1
        self.correction, self.tracked_until_ns, self._before_jump = Correction(), None, None

    def _absorb(self, jump_enu_m: Floats) -> None:
        """Keep the place on the map through a jump of the estimate."""
        self.absorbed += 1
        self._stretch += 1
        self._before_jump = int(self._positions.stamp_ns[-1]), self.correction
        self.correction = self.correction.after_jump(jump_enu_m)

    @property
    def bracketed_until_ns(self) -> int | None:
        """Newest time covered by certain stamps of both attitude and position, None without either."""
        attitude, position = self._attitudes.newest_ns, self._positions.newest_ns
        if attitude is None or position is None:
            return None
        if self._trusts_all:
            return min(attitude, position)
        return None if self._certain_ns is None else min(attitude, position, self._certain_ns)

    def samples(self) -> tuple[NDArray[np.int64], Floats, NDArray[np.int64], Floats, int]:
        """Return the kernels' inputs: stamps and samples of attitude and position, and the longest gap."""
        a, p = self._attitudes, self._positions
        return a.stamp_ns, a.values, p.stamp_ns, p.values, self._limit_ns

    def interpolate(self, stamp_ns: NDArray[np.int64]) -> Poses:
        """Return the autopilot's poses at stamps (n,): none is extrapolated, or across gaps or jumps."""
        n = len(stamp_ns)
        poses = Poses(np.empty((n, 3)), np.empty((n, 3, 3)), np.empty(n, dtype=np.bool_))
        interpolate(
            np.ascontiguousarray(stamp_ns),
            *self.samples(),
            poses.position_enu_m,
            poses.rotation_enu_from_frd,
            poses.valid,
        )
        return poses

    def velocity_enu_ms(self, stamp_ns: int) -> Floats:
        """Return the autopilot's velocity (3,) at a time between its samples, that of an end beyond them."""
        at, axes = self._positions.stamp_ns, self._positions.values[:, 3:6].T
        return np.array([np.interp(stamp_ns, at, axis) for axis in axes])

    def at(self, stamp_ns: int) -> Pose | None:
        """Return the pose on the map at a time between samples; None beyond them, in gaps and at jumps."""
        poses = self.interpolate(np.array([stamp_ns]))
        if not poses.valid[0]:
            return None
        pose = Pose(
            stamp_ns=stamp_ns,
            position_enu_m=poses.position_enu_m[0],
            velocity_enu_ms=self.velocity_enu_ms(stamp_ns),
            quat_wxyz=quaternion_wxyz(poses.rotation_enu_from_frd[0]),
            epoch=self.epoch,
        )
        return self.correction.pose(pose)

    def latest(self, now_ns: int) -> Pose | None:
        """Return the newest pose on the map, extrapolated to now by at most 0.1 s; None if it is stale.

        Its stamp is the time to which it was extrapolated.
        """
        attitude_ns, position_ns = self._attitudes.newest_ns, self._positions.newest_ns
        if attitude_ns is None or position_ns is None:
            return None
        if max(abs(now_ns - attitude_ns), abs(now_ns - position_ns)) > self._limit_ns:
            return None
        asked = now_ns, attitude_ns, position_ns, self.epoch, self._mappings, id(self.correction)
        if self._latest is not None and self._latest[0] == asked:
            return self._latest[1]
        stamp_ns = min(now_ns, min(attitude_ns, position_ns) + round(EXTRAPOLATION_S * 1e9))
        sample = self._positions.values[-1]
        velocity = sample[3:6].copy()
        pose = Pose(
            stamp_ns=stamp_ns,
            position_enu_m=sample[:3] + velocity * _bounded_s(stamp_ns - position_ns),
            velocity_enu_ms=velocity,
            quat_wxyz=turned(self._attitudes.values[-1], self._rates, _bounded_s(stamp_ns - attitude_ns)),
            epoch=self.epoch,
        )
        self._latest = asked, self.correction.pose(pose)
        return self._latest[1]

    # ---- acceptance of samples ------------------------------------------------------------------

    def _is_next(self, track: SampleBuffer, stamp_ns: int) -> bool:
        """Return whether a stamp is newer than the last; a far older one means that the clock restarted."""
        newest = track.newest_ns
        if newest is None or stamp_ns > newest:
            return True
        if newest - stamp_ns <= self._limit_ns:
            return False
        self.clear()
        return True

    @staticmethod
    def _is_place(lat_deg: float, lon_deg: float, alt_m: float, velocity: Floats) -> bool:
        """Return whether position and velocity are finite and on Earth."""
        on_earth = abs(lat_deg) <= 90 and abs(lon_deg) <= 180
        return on_earth and math.isfinite(alt_m) and all(map(math.isfinite, velocity.tolist()))

    def _jump_m(self, stamp_ns: int, position: Floats, velocity: Floats) -> Floats | None:
        """Return the jump (3,) of the estimate to a position, None if it is motion."""
        if not len(self._positions):
            return None
        last = self._positions.values[-1]
        elapsed_s = (stamp_ns - int(self._positions.stamp_ns[-1])) * 1e-9
        way = (last[3:6] + velocity) * (elapsed_s / 2)
        allowed_m = motion_m(elapsed_s, self._limit_ns * 1e-9)
        if last[STRETCH] != self._stretch:  # the clock jumped in between: the elapsed time is unknown
            allowed_m += float(np.linalg.norm(way))
        jump: Floats = position - last[:3] - way
        return jump if math.sqrt(jump.dot(jump)) > allowed_m else None

    def _is_of_height(self, jump_enu_m: Floats, stamp_ns: int) -> bool:
        """Return whether a jump is a reset of the height alone, between two samples without a gap."""
        elapsed_ns = stamp_ns - int(self._positions.stamp_ns[-1])
        level_m = math.hypot(jump_enu_m[0], jump_enu_m[1])
        return elapsed_ns <= self._limit_ns and level_m <= motion_m(elapsed_ns * 1e-9, self._limit_ns * 1e-9)


def motion_m(elapsed_s: float, timeout_s: float) -> float:
    """Return the greatest distance in m between a vehicle and its prediction by the mean velocity.

    `elapsed_s` beyond `timeout_s` is a gap, through which no manoeuvre as hard as between two samples lasts.
    """
    aside_ms2 = ACCELERATION_MS2 / 2 if elapsed_s <= timeout_s else GAP_ACCELERATION_MS2 / 4
    return float(JUMP_M + aside_ms2 * elapsed_s**2)


def _bounded_s(nanoseconds: int) -> float:
    return min(max(nanoseconds * 1e-9, -EXTRAPOLATION_S), EXTRAPOLATION_S)
