"""Aiding of the position estimate by GPS or external navigation, dead reckoning, and the filter's status.

Rules and times are those of ArduPilot's EKF3 (AP_NavEKF3_Control.cpp, _PosVelFusion.cpp) and of an ArduCopter
4.7 SITL without GPS. A position within five standard deviations of the estimate is followed; another is
rejected, until the filter resets itself to it. A new source is taken by a reset at its first position.
Without GPS, position, velocity and tilt are those of a Kalman filter (`InertialFilter`): velocities and
positions from outside are fused at the gains and within the gates that its covariance gives.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.external_navigation import DEFAULTS as EXTERNAL_DEFAULTS
from sitl.autopilot.aiding.external_navigation import ExternalNavigation, ExternalPose
from sitl.autopilot.aiding.inertial_filter import (
    POSITION,
    TILT,
    VELOCITY,
    InertialFilter,
)
from sitl.autopilot.aiding.source_sets import DEFAULTS as SOURCE_DEFAULTS
from sitl.autopilot.aiding.source_sets import GnssReceiver, HeightAiding, Source, SourceSets
from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]

TIMEOUT_S, STOPPED_S = 7.3, 15.2
"""Time without a position after which the filter abandons its own, and then holds it constant."""
GLITCH_S, GLITCH_OVER_S = 1.0, 10.0
"""Time of rejected, and then of accepted, positions after which the filter reports a glitch, or its end."""
RETRY_S = 10.0
"""Time of rejected positions, with accepted velocities, after which the filter resets itself to them."""
DRIFT_S, DRIFT_MS2 = 10.0, 0.034
"""Dead reckoning integrates the acceleration error of a tilt, 0.2 degrees: 1.7 m after ten seconds, and no
further. It is one standard deviation of `InertialFilter` after a minute of GPS."""
PULL_IN_S, CONVERGED_M = 1.0, 1e-3
REALIGN_S = 2.0
TEST_RATIO = 0.02
GATE_SIGMA = 5.0
GPS_ERROR_M, OWN_ERROR_M, OWN_YAW_ERROR_RAD = 0.5, 0.2, 0.03
"""Standard deviations of GPS (EK3_POSNE_M_NSE) and of the settled estimate, per axis."""
FILTER_STEP_S = 0.012
POSITION_GATE, VELOCITY_GATE = 5.0, 5.0
"""Standard deviations: EK3_POS_I_GATE, EK3_VEL_I_GATE."""
SILENT_NS = 300_000_000
"""Time without a pose after which the filter's velocity begins to drift."""
REMEMBERED = 128

AIDED: int = (
    mavlink.EKF_ATTITUDE
    | mavlink.EKF_VELOCITY_HORIZ
    | mavlink.EKF_VELOCITY_VERT
    | mavlink.EKF_POS_HORIZ_REL
    | mavlink.EKF_POS_HORIZ_ABS
    | mavlink.EKF_POS_VERT_ABS
    | mavlink.EKF_PRED_POS_HORIZ_REL
    | mavlink.EKF_PRED_POS_HORIZ_ABS
)
TIMED_OUT: int = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS
UNAIDED: int = TIMED_OUT | mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_CONST_POS_MODE
LEVEL: F64 = np.array([1.0, 1.0, 0.0])


class ExternalReceiver(Protocol):
    """Interface of a receiver of external poses, see `ExternalNavigation`."""

    @property
    def enabled(self) -> bool: ...

    def restart(self) -> None: ...

    def is_healthy(self, now_ns: int) -> bool: ...

    def on_odometry(self, message: Any, now_ns: int) -> None: ...

    def on_vision_position(self, message: Any, now_ns: int) -> None: ...

    def on_vision_speed(self, message: Any, now_ns: int) -> None: ...

    def drain(self, filter_enu_m: F64 | None) -> list[ExternalPose]: ...


class PositionAiding:
    """Horizontal and heading error of the estimate by its sources, and the reports of EKF and receiver.

    It knows what the filter knows: positions from its sources, and its own estimates, see `remember`.

    Parameters
    ----------
    parameters
        Of the autopilot; None for the defaults, GPS and compass.

    Attributes
    ----------
    gnss
        The receiver.
    height
        Height by the barometer.
    sources
        Source sets.
    external
        External navigation.
    compass_error_rad
        Error of the compass's heading, set by faults.
    absolute
        Whether the filter reports a valid absolute horizontal position.
    offset_enu_m, velocity_error_enu_ms
        (3,) added to the estimate.
    acceleration_error_enu_ms2
        (3,) by which the filter's prediction errs, because its tilt is wrong.
    heading_error_rad
        Clockwise, added to the estimate.
    """

    filter_step_s = FILTER_STEP_S
    position_gate, velocity_gate = POSITION_GATE, VELOCITY_GATE

    def __init__(self, parameters: dict[str, float] | None = None) -> None:
        known = SOURCE_DEFAULTS | EXTERNAL_DEFAULTS if parameters is None else parameters
        self.gnss, self.height = GnssReceiver(), HeightAiding()
        self.sources = SourceSets(known)
        self.external: ExternalReceiver = ExternalNavigation(known)
        self._heading = HeadingAiding()
        self.compass_error_rad = 0.0
        self.absolute = True
        self.offset_enu_m: F64 = np.zeros(3)
        self.velocity_error_enu_ms: F64 = np.zeros(3)
        self.acceleration_error_enu_ms2: F64 = np.zeros(3)
        self._filter = InertialFilter(self.filter_step_s)
        self._direction: F64 = np.array([0.0, 1.0, 0.0])
        self._source = self.sources.position
        self._switched = False
        self._since_s = 0.0
        self._rejected_s = self._accepted_s = 0.0
        self._is_glitching = False
        self._ratio = 0.0
        self._steady = True
        self._reset_enu_m: F64 | None = None
        self._now_ns = 0
        self._fused_ns = self._velocity_ns = 0
        self._past: deque[tuple[int, F64, F64, float]] = deque(maxlen=REMEMBERED)

    # ---- faults and commands ------------------------------------------------------------------------

    @property
    def gps(self) -> bool:
        """True if the receiver has a fix."""
        return self.gnss.has_fix

    def lose_gps(self, bearing_rad: float) -> None:
        """Remove the fix; the estimate drifts towards a bearing, clockwise from north."""
        self.gnss.has_fix = self._steady = False
        self._direction = np.array([math.sin(bearing_rad), math.cos(bearing_rad), 0.0])
        if self._source is Source.GPS:
            self._since_s = 0.0
            self._begin_alone()

    def _begin_alone(self) -> None:
        """Begin without GPS, with the tilt of a settled filter: an unlucky one, of one standard deviation."""
        self._filter.settle()
        self.acceleration_error_enu_ms2 = DRIFT_MS2 * self._direction

    def regain_gps(self) -> None:
        """Restore the fix: the estimate converges, or is reset if the filter had abandoned its position."""
        self.gnss.has_fix = True
        if self._source is Source.GPS:
            self._since_s = 0.0
            self.velocity_error_enu_ms = np.zeros(3)
            self.acceleration_error_enu_ms2 = np.zeros(3)

    def restart(self) -> None:
        """Apply a restart of the autopilot to sources and external navigation."""
        self.sources.restart()
        self.external.restart()

    # ---- filter -------------------------------------------------------------------------------------

    def remember(self, now_ns: int, estimate: State) -> None:
        """Store an estimate, so that a late pose is compared with the estimate of its own time."""
        self._now_ns = now_ns
        if self.external.enabled and (not self._past or now_ns - self._past[-1][0] >= SILENT_NS // 60):
            yaw = to_euler(estimate.quat_wxyz)[2] - self.heading_error_rad
            place = estimate.pos_enu_m - self.offset_enu_m
            self._past.append((now_ns, place, estimate.vel_enu_ms - self.velocity_error_enu_ms, yaw))

    @property
    def heading_error_rad(self) -> float:
        """Error of the estimated heading, clockwise."""
        return self._heading.error_rad

    def update(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        source = self.sources.position
        if source is not self._source:
            self._switch(source)
        self._heading.update(dt_s, self.sources.heading, self.compass_error_rad)
        if self.external.enabled:
            self._take_poses()
        self._steady = self._steady and not self.gnss.is_faulty
        if self._steady:
            return
        self._since_s += dt_s
        if source is Source.EXTERNAL:
            self._between_poses(dt_s)
        elif source is Source.GPS and self.gnss.has_fix:
            self._aided(dt_s)
        else:
            self._unaided(dt_s)

    def _switch(self, source: Source) -> None:
        """Change the source; its first position will reset the estimate."""
        if self._source is Source.GPS and self.gnss.has_fix:
            self._since_s = 0.0
            self._begin_alone()
        self._source, self._switched = source, True
        self._steady, self._rejected_s, self._ratio = False, 0.0, 0.0

    def _unaided(self, dt_s: float) -> None:
        self.absolute = self.absolute and self._since_s < TIMEOUT_S
        self._predict(dt_s)

    def _predict(self, dt_s: float) -> None:
        """Dead-reckon; a filter that measures nothing for long holds its position."""
        if self._since_s >= DRIFT_S:
            self.velocity_error_enu_ms = self.acceleration_error_enu_ms2 = np.zeros(3)
        self._filter.predict(dt_s)
        self.velocity_error_enu_ms = self.velocity_error_enu_ms + self.acceleration_error_enu_ms2 * dt_s
        self.offset_enu_m = self.offset_enu_m + self.velocity_error_enu_ms * dt_s

    # ---- GPS ----------------------------------------------------------------------------------------

    def _aided(self, dt_s: float) -> None:
        wrong = self.gnss.error_enu_m
        if self._switched and not self.stopped:
            self._reset_to(wrong)
            return
        if self.absolute:
            self._follow_gps(dt_s, wrong)
        elif self._since_s >= REALIGN_S:
            self._reset_to(wrong)

    def _reset_to(self, offset_enu_m: F64) -> None:
        """Reset the estimate to GPS."""
        self._reset_by(offset_enu_m - self.offset_enu_m)
        self.velocity_error_enu_ms = self.gnss.velocity_error_enu_ms.copy()
        self.acceleration_error_enu_ms2 = np.zeros(3)
        self._steady = not self.gnss.is_faulty and not self._is_glitching

    def _follow_gps(self, dt_s: float, wrong_enu_m: F64) -> None:
        apart = wrong_enu_m - self.offset_enu_m
        self._ratio = gate_share(apart, GPS_ERROR_M)
        if self._ratio >= 1.0:
            self._rejected_s += dt_s
            self._accepted_s = 0.0
            self._is_glitching = self._is_glitching or self._rejected_s > GLITCH_S
            self.velocity_error_enu_ms = np.zeros(3)
            if self._rejected_s >= RETRY_S:
                self._reset_to(wrong_enu_m)
            return
        self._rejected_s = 0.0
        self._accepted_s += dt_s
        self._is_glitching = self._is_glitching and self._accepted_s <= GLITCH_OVER_S
        velocity = self.gnss.velocity_error_enu_ms
        self.velocity_error_enu_ms = velocity.copy()
        share = min(1.0, dt_s / PULL_IN_S)
        self.offset_enu_m = self.offset_enu_m + apart * share + velocity * dt_s
        if not self.gnss.is_faulty and np.abs(self.offset_enu_m).max() < CONVERGED_M:
            self._steady, self._ratio = not self._is_glitching, 0.0
            self.offset_enu_m = np.zeros(3)

    # ---- external navigation ------------------------------------------------------------------------

    def _take_poses(self) -> None:
        """Fuse the poses that arrived, or align them while another source is in use."""
        if not self._past:
            return
        aligns = self._aligns and self._source is not Source.EXTERNAL
        here = self._past[-1][1] + self.offset_enu_m if aligns else None
        for pose in self.external.drain(here):
            if self._source is Source.EXTERNAL:
                self._fuse(pose)
            self._fuse_heading(pose)

    @property
    def _aligns(self) -> bool:
        return self.absolute and self.sources.has_external_position

    def _remembered(self, stamp_ns: int) -> tuple[F64, F64, float]:
        """Return the estimate (position, velocity, heading) of a time, with the corrections since."""
        at_ns, place, velocity, yaw = min(self._past, key=lambda past: abs(past[0] - stamp_ns))
        age_s = (self._now_ns - at_ns) * 1e-9
        faster = self.acceleration_error_enu_ms2 * age_s
        return (
            place + self.offset_enu_m - (self.velocity_error_enu_ms - faster / 2) * age_s,
            velocity + self.velocity_error_enu_ms - faster,
            yaw + self.heading_error_rad,
        )

    def _fuse(self, pose: ExternalPose) -> None:
        """Fuse velocity, then position, as the filter's covariance and gates have it."""
        place, velocity, _ = self._remembered(pose.stamp_ns)
        apart = (pose.position_enu_m - place) * LEVEL
        ratio = self._filter.test_ratio(POSITION, apart, pose.error_m, self.position_gate)
        if pose.velocity_enu_ms is not None and self.sources.velocity is Source.EXTERNAL:
            self._velocity_ns = self._now_ns
            self._fuse_velocity((pose.velocity_enu_ms - velocity) * LEVEL, pose)
        self._ratio = ratio
        if self._switched or pose.is_reset or not self.absolute:
            if not self.absolute:
                self.velocity_error_enu_ms = np.zeros(3)
            self._filter.reset(POSITION, pose.error_m)
            self._reset_by(apart)
            self._fused_ns = self._now_ns
        elif ratio < 1.0:
            self._fuse_position(pose)
            self._since_s, self._fused_ns = 0.0, self._now_ns

    def _fuse_velocity(self, apart_enu_ms: F64, pose: ExternalPose) -> None:
        error_ms = pose.velocity_error_ms
        if self._filter.test_ratio(VELOCITY, apart_enu_ms, error_ms, self.velocity_gate) < 1.0:
            self._correct(self._filter.gain(VELOCITY, error_ms), apart_enu_ms, pose)

    def _fuse_position(self, pose: ExternalPose) -> None:
        apart = (pose.position_enu_m - self._remembered(pose.stamp_ns)[0]) * LEVEL
        self._correct(self._filter.gain(POSITION, pose.error_m), apart, pose)

    def _correct(self, gain: F64, apart_enu: F64, pose: ExternalPose) -> None:
        """Correct the estimate of a pose's time, and carry the correction on to the present."""
        age_s = (self._now_ns - pose.stamp_ns) * 1e-9
        faster = gain[VELOCITY] + gain[TILT] * age_s
        farther = gain[POSITION] + (gain[VELOCITY] + gain[TILT] * age_s / 2) * age_s
        self.acceleration_error_enu_ms2 = self.acceleration_error_enu_ms2 + gain[TILT] * apart_enu
        self.velocity_error_enu_ms = self.velocity_error_enu_ms + faster * apart_enu
        self.offset_enu_m = self.offset_enu_m + farther * apart_enu

    def _between_poses(self, dt_s: float) -> None:
        """Dead-reckon from pose to pose, and abandon the position when none was taken for long."""
        moving = self._now_ns - self._velocity_ns < SILENT_NS
        self.absolute = self.absolute and self._since_s < (RETRY_S if moving else TIMEOUT_S)
        self._predict(dt_s)

    def _fuse_heading(self, pose: ExternalPose) -> None:
        if pose.yaw_rad is not None and self.sources.heading is Source.EXTERNAL:
            yaw = self._remembered(pose.stamp_ns)[2]
            self._heading.correct(math.remainder(pose.yaw_rad - yaw, 2 * math.pi), pose.yaw_error_rad)

    # ---- resets and reports -------------------------------------------------------------------------

    def _reset_by(self, jump_enu_m: F64) -> None:
        self.offset_enu_m = self.offset_enu_m + jump_enu_m
        before = np.zeros(3) if self._reset_enu_m is None else self._reset_enu_m
        self._reset_enu_m = before + jump_enu_m
        self.absolute, self._switched = True, False
        self._since_s = self._rejected_s = self._ratio = 0.0

    def take_reset(self) -> F64 | None:
        """Return the jump of resets since the last call, None without one."""
        jump, self._reset_enu_m = self._reset_enu_m, None
        return jump

    def gps_position(self, estimate: State) -> F64:
        """Return the receiver's position (3,) ENU, for the estimate of the same time."""
        return estimate.pos_enu_m - self.offset_enu_m + self.gnss.error_enu_m

    @property
    def stopped(self) -> bool:
        """True if the filter has stopped aiding and holds its position constant."""
        realigns = self._source is Source.GPS and self.gnss.has_fix and not self._switched
        return not self.absolute and (realigns or self._since_s >= STOPPED_S)

    @property
    def flags(self) -> int:
        """Flags of EKF_STATUS_REPORT."""
        if self.absolute:
            return AIDED | (mavlink.EKF_GPS_GLITCHING if self._is_glitching else 0)
        return UNAIDED if self.stopped else TIMED_OUT

    @property
    def test_ratio(self) -> float:
        """Horizontal test ratio, called a variance in EKF_STATUS_REPORT: without GPS nothing is tested."""
        return 0.0 if self.stopped else TEST_RATIO

    @property
    def position_test_ratio(self) -> float:
        """Test ratio of the positions: 1 and above are rejected."""
        return max(self.test_ratio, 0.0 if self.stopped else self._ratio)

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the receiver."""
        return self.gnss.fix_type


class HeadingAiding:
    """Error of the estimated heading, which follows the compass or external navigation."""

    def __init__(self) -> None:
        self.error_rad = 0.0
        self._source = Source.COMPASS
        self._switched = False

    def update(self, dt_s: float, source: Source, compass_error_rad: float) -> None:
        """Follow the compass, if it is the source; another that is silent leaves the heading to the gyro."""
        if source is not self._source:
            self._source, self._switched = source, True
        if source is not Source.COMPASS or self.error_rad == compass_error_rad:
            return
        share = 1.0 if self._switched else min(1.0, dt_s / PULL_IN_S)
        self.error_rad += share * (compass_error_rad - self.error_rad)
        self._switched = False

    def correct(self, apart_rad: float, error_rad: float) -> None:
        """Follow an external heading; the first one of a new source resets the estimate."""
        share = 1.0 if self._switched else OWN_YAW_ERROR_RAD**2 / (OWN_YAW_ERROR_RAD**2 + error_rad**2)
        self.error_rad += share * apart_rad
        self._switched = False


def gate_share(apart_enu_m: F64, error_m: float) -> float:
    """Return the distance of a position from the estimate as a share of the greatest that is followed."""
    gate_m = GATE_SIGMA * math.sqrt(2.0 * (error_m**2 + OWN_ERROR_M**2))
    return float(np.hypot(apart_enu_m[0], apart_enu_m[1])) / gate_m
