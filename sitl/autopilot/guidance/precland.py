"""Precision landing on LANDING_TARGET, with the behaviour measured on ArduCopter.

Only MAV_FRAME_BODY_FRD with position_valid and a distance leads to the target. MAV_FRAME_LOCAL_FRD is
accepted too, but leads elsewhere, because the vector is not rotated by the heading. The target is valid after
two seconds of updates without a gap of half a second. When the updates stop, it is predicted for two seconds,
and then lost. Every target is turned by PLND_YAW_ALIGN and shifted by PLND_LAND_OFS and PLND_CAM_POS, which
were meant for an IR-LOCK. Only a landing reads the target: it moves no other mode (AC_PrecLand.cpp).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.rigid_body import State, ned, rotate

F64 = NDArray[np.float64]

NEEDED_NS = 2_000_000_000
GAP_NS = 500_000_000
PREDICTED_NS = 2_000_000_000
FORGOTTEN_NS, FORGOTTEN_M = 180_000_000_000, 30.0
BODY_FRD, LOCAL_FRD = 12, 20
FILTER_SHARE = 0.25
INFO, CRITICAL = mavlink.MAV_SEVERITY_INFO, mavlink.MAV_SEVERITY_CRITICAL
NONE, SEEN, BELIEVED = range(3)
RISING = {SEEN: "PrecLand: Target Found", BELIEVED: "PrecLand: Init Complete"}
FALLING = {SEEN: "PrecLand: Init Failed", BELIEVED: "PrecLand: Target Lost"}


class Sight(Enum):
    """State of the target (AC_PrecLand::TargetState)."""

    NEVER_SEEN = auto()
    OUT_OF_RANGE = auto()
    RECENTLY_LOST = auto()
    FOUND = auto()


class PrecisionLanding:
    """Estimator of the landing target in the estimate's own east-north-up frame.

    Attributes
    ----------
    sight
        State of the target; OUT_OF_RANGE without a healthy rangefinder between PLND_ALT_MIN and PLND_ALT_MAX.
    measured_down_m
        Height of the vehicle over the target in the newest measurement.
    vehicle_enu_m, seen_enu_m
        Vehicle at the newest measurement, and the newest valid target at that height.
    valid_ns
        Time at which the target was last valid.
    """

    def __init__(self) -> None:
        self.sight = Sight.NEVER_SEEN
        self.measured_down_m = 0.0
        self.vehicle_enu_m, self.seen_enu_m = np.zeros(3), np.zeros(3)
        self.valid_ns = 0
        self._texts: list[tuple[int, str]] = []
        self._poses: deque[tuple[int, F64, F64]] = deque(maxlen=128)
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._last_stamp: int | None = None
        self._target: F64 | None = None
        self.frame_refused = False
        self._stage = NONE

    def remember(self, now_ns: int, estimate: State) -> None:
        """Store the pose, so that a target can be located with the pose of its own time."""
        self._poses.append((now_ns, estimate.pos_enu_m, estimate.quat_wxyz))

    def receive(self, message: Any, now_ns: int, parameters: Mapping[str, float]) -> str | None:
        """Process a LANDING_TARGET; return a text for the operator when its frame is first refused."""
        if not message.position_valid or message.frame not in (BODY_FRD, LOCAL_FRD):
            if self.frame_refused or not message.position_valid:
                return None
            self.frame_refused = True
            return "Plnd: Frame not supported"
        body = np.array([message.x, message.y, message.z], np.float64)
        if not message.distance > 0 or not np.isfinite([*body, message.distance]).all() or not self._poses:
            return None
        if message.frame == BODY_FRD and not body[2] > 0:
            return None  # not below: no measurement (AC_PrecLand, target_vec_valid)
        if message.time_usec == self._last_stamp:
            return None
        self._last_stamp = message.time_usec
        wanted = now_ns - round(parameters["PLND_LAG"] * 1e9)
        _, position, attitude = min(self._poses, key=lambda pose: abs(pose[0] - wanted))
        body = _turned(body, math.radians(parameters["PLND_YAW_ALIGN"] / 100))
        measured = position + ned(body if message.frame == LOCAL_FRD else rotate(attitude, body))
        measured = measured + ned(rotate(attitude, _shift_m(parameters)))
        self.measured_down_m = float(position[2] - measured[2])
        self.vehicle_enu_m = self._poses[-1][1].copy()
        self.seen_enu_m[2] = self.vehicle_enu_m[2]
        if self._last_ns is None or now_ns - self._last_ns > GAP_NS or self._target is None:
            self._first_ns = now_ns if not self.acquired(now_ns) else self._first_ns
            self._target = measured
        else:
            self._target = self._target + FILTER_SHARE * (measured - self._target)
        self._last_ns = now_ns
        return None

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate."""
        moved = [(stamp, position + jump_enu_m, attitude) for stamp, position, attitude in self._poses]
        self._poses = deque(moved, maxlen=self._poses.maxlen)
        self._target = None if self._target is None else self._target + jump_enu_m
        self.vehicle_enu_m, self.seen_enu_m = self.vehicle_enu_m + jump_enu_m, self.seen_enu_m + jump_enu_m

    def check_sight(
        self, place_enu_m: F64, now_ns: int, rangefinder_m: float | None, parameters: Mapping[str, float]
    ) -> None:
        """Update `sight` (check_target_status); `rangefinder_m` is None if unhealthy."""
        target = self.target(now_ns)
        if target is not None:
            self.sight, self.valid_ns = Sight.FOUND, now_ns
            self.seen_enu_m[:2] = target[:2]
            return
        seen = self.sight in (Sight.FOUND, Sight.RECENTLY_LOST)
        if not _is_in_range(rangefinder_m, parameters):
            self.sight = Sight.OUT_OF_RANGE
            return
        far_m = max(
            float(np.hypot(*(place_enu_m - was)[:2])) for was in (self.seen_enu_m, self.vehicle_enu_m)
        )
        recent = now_ns - self.valid_ns <= FORGOTTEN_NS and far_m <= FORGOTTEN_M
        self.sight = Sight.RECENTLY_LOST if seen and recent else Sight.NEVER_SEEN

    def announce(self, text: str) -> None:
        """Add a text of severity INFO to `status_texts`."""
        self._texts.append((INFO, text))

    def acquired(self, now_ns: int) -> bool:
        """Return whether the target is valid now."""
        if self._first_ns is None or self._last_ns is None:
            return False
        long_enough = self._last_ns - self._first_ns >= NEEDED_NS
        return long_enough and now_ns - self._last_ns <= PREDICTED_NS

    def status_texts(self, now_ns: int) -> list[tuple[int, str]]:
        """Return severity and text of each announcement and change of the target since the last call."""
        before, self._stage = self._stage, self._stage_now(now_ns)
        announced, self._texts = self._texts, []
        if self._stage < before:
            lost = [(CRITICAL, FALLING[before]), *announced]
            return lost if self._stage == NONE else [*lost, (INFO, RISING[self._stage])]
        return [*announced, *((INFO, RISING[stage]) for stage in range(before + 1, self._stage + 1))]

    def _stage_now(self, now_ns: int) -> int:
        if self.acquired(now_ns):
            return BELIEVED
        return SEEN if self._last_ns is not None and now_ns - self._last_ns <= GAP_NS else NONE

    def target(self, now_ns: int) -> F64 | None:
        """Return the target (3,) east, north, up, or None while it is not valid."""
        return self._target if self.acquired(now_ns) else None

    @property
    def latest_enu_m(self) -> F64 | None:
        """Latest accepted target, valid or not."""
        return self._target


def _is_in_range(rangefinder_m: float | None, parameters: Mapping[str, float]) -> bool:
    """Return whether a target must be in sight at this height (check_if_sensor_in_range)."""
    lowest, highest = parameters["PLND_ALT_MIN"], parameters["PLND_ALT_MAX"]
    if not lowest and not highest:
        return True
    return rangefinder_m is not None and lowest <= rangefinder_m <= (highest or math.inf)


def _turned(body_m: F64, angle_rad: float) -> F64:
    """Return a vector forward, right, down, turned clockwise seen from above."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    forward, right, down = (float(v) for v in body_m)
    return np.array([cosine * forward - sine * right, sine * forward + cosine * right, down])


def _shift_m(parameters: Mapping[str, float]) -> F64:
    """Return the shift (3,) forward, right, down: of the camera's place only the height is left."""
    x_cm, y_cm = parameters["PLND_LAND_OFS_X"], parameters["PLND_LAND_OFS_Y"]
    return np.array([x_cm / 100, y_cm / 100, parameters["PLND_CAM_POS_Z"]])
