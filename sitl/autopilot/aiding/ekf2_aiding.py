"""Aiding as in PX4's EKF2: GNSS and external vision together (aid_sources/gnss, aid_sources/external_vision).

While GNSS is fused it is the reference: external vision (EV) holds the estimate against its own bias, which
is tracked, and never moves it. 7 s after GNSS ends, or 7 s after its positions are rejected while EV is fused
(a fault then, for good), EV becomes the reference: the bias is dropped and the estimate is reset to the EV
position as sent. GNSS that returns while EV is fused is taken only if it is near the estimate. Without any
position for EKF2_NOAID_TOUT (5 s) the horizontal position is not valid. An EV frame of its own heading (FRD)
is turned into the filter's, unless its heading is fused. Only the filter is PX4's here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.ekf2_odometry import Ekf2Odometry
from sitl.autopilot.aiding.external_navigation import ExternalPose
from sitl.autopilot.aiding.inertial_filter import POSITION
from sitl.autopilot.aiding.source_sets import Source
from sitl.autopilot.position_aiding import (
    GPS_ERROR_M,
    LEVEL,
    PULL_IN_S,
    PositionAiding,
    gate_share,
)

F64 = NDArray[np.float64]

RESET_S = 7.0
EV_TIMEOUT_NS, EV_FAILS_NS = 400_000_000, 1_000_000_000
START_SHARE = 0.5
FILTER_STEP_S = 0.01
VELOCITY_GATE = 3.0
"""EKF2_EVV_GATE; that of the position is EKF3's."""
BIAS_SHARE = 0.1
HORIZONTAL, SPEED, HEADING = 1, 4, 8
VALID: int = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)
INVALID: int = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_VERT | mavlink.ESTIMATOR_POS_VERT_ABS


class Ekf2Aiding(PositionAiding):
    """Aiding with EKF2's rules.

    Attributes
    ----------
    fuses_gnss, fuses_vision
        Whether each is fused for the horizontal position.
    """

    filter_step_s = FILTER_STEP_S
    velocity_gate = VELOCITY_GATE

    def __init__(self, parameters: dict[str, float]) -> None:
        super().__init__(parameters)
        self._parameters = parameters
        self._odometry = Ekf2Odometry(parameters)
        self.external = self._odometry
        self.fuses_gnss, self.fuses_vision = True, False
        self._gnss_fault = False
        self._gnss_s = 0.0
        """Time since GNSS was fused; while it is not, time of its good health."""
        self._bias_enu_m: F64 | None = None
        self._turn_rad: float | None = None
        self._vision_ns = -EV_FAILS_NS

    # ---- filter -------------------------------------------------------------------------------------

    def update(self, dt_s: float) -> None:
        bits = int(self._parameters["EKF2_EV_CTRL"])
        self._since_s += dt_s
        self._steady = self._steady and not self.gnss.is_faulty and self.fuses_gnss
        heading = Source.EXTERNAL if self._fuses_heading(bits) else Source.COMPASS
        self._heading.update(dt_s, heading, self.compass_error_rad)
        self._time_out()
        if self._past:
            for pose in self.external.drain(None):
                self._fuse_vision(pose, bits)
        if self.fuses_gnss:
            self._use_gnss(dt_s)
        else:
            self._await_gnss(dt_s)
        if not self.fuses_gnss or not self.gnss.has_fix:
            self._predict(dt_s)
        self.absolute = self._since_s < self._parameters["EKF2_NOAID_TOUT"]

    def _fuses_heading(self, bits: int) -> bool:
        recent = self._now_ns - self._vision_ns < EV_TIMEOUT_NS
        return bool(bits & HEADING) and recent and not (self._odometry.is_turned and self.fuses_gnss)

    def _time_out(self) -> None:
        if self.fuses_vision and self._now_ns - self._vision_ns > EV_FAILS_NS:
            self.fuses_vision, self._turn_rad = False, None

    def regain_gps(self) -> None:
        self.gnss.has_fix = True

    # ---- GNSS ---------------------------------------------------------------------------------------

    def _use_gnss(self, dt_s: float) -> None:
        apart = self.gnss.error_enu_m - self.offset_enu_m
        if self.gnss.has_fix:
            self._ratio = gate_share(apart, GPS_ERROR_M)
        if self.gnss.has_fix and self._ratio < 1.0:
            self._gnss_s = self._since_s = 0.0
            if not self._steady:
                self.velocity_error_enu_ms = self.gnss.velocity_error_enu_ms.copy()
                self.acceleration_error_enu_ms2 = np.zeros(3)
                moved = self.velocity_error_enu_ms * dt_s
                self.offset_enu_m = self.offset_enu_m + apart * min(1.0, dt_s / PULL_IN_S) + moved
            return
        self._gnss_s += dt_s
        if self._gnss_s < RESET_S:
            return
        if self.gnss.has_fix and not self.fuses_vision:
            self._reset_by(apart)
        else:
            self.fuses_gnss = False
            self._gnss_fault = self.gnss.has_fix
        self._gnss_s = 0.0

    def _await_gnss(self, dt_s: float) -> None:
        """Begin with GNSS again after its health time: near the estimate, or by a reset if it is alone."""
        healthy = self.gnss.has_fix and not self._gnss_fault
        self._gnss_s = self._gnss_s + dt_s if healthy else 0.0
        if self._gnss_s < self._parameters["EKF2_REQ_GPS_H"]:
            return
        apart = self.gnss.error_enu_m - self.offset_enu_m
        near = gate_share(apart, GPS_ERROR_M) < START_SHARE
        if not near and self.fuses_vision:
            return
        if not near or not self.absolute:
            self._reset_by(apart)
        self.fuses_gnss, self._bias_enu_m, self._gnss_s = True, None, 0.0

    # ---- external vision ----------------------------------------------------------------------------

    def _fuse_vision(self, pose: ExternalPose, bits: int) -> None:
        least = self._parameters["EKF2_EV_QMIN"]
        if least > 0 and self._odometry.quality < least:
            return
        _, velocity, yaw = self._remembered(pose.stamp_ns)
        if pose.yaw_rad is not None:
            self._track_heading(math.remainder(pose.yaw_rad - yaw, 2 * math.pi), pose, bits)
        alone = not (self.fuses_gnss and self.gnss.has_fix)
        if bits & SPEED and pose.velocity_enu_ms is not None and alone:
            self._fuse_velocity((self._turned(pose.velocity_enu_ms, bits) - velocity) * LEVEL, pose)
        if bits & HORIZONTAL:
            place = self._remembered(pose.stamp_ns)[0]
            self._fuse_vision_position(self._turned(pose.position_enu_m, bits), place, pose)
        self._vision_ns = self._now_ns if not bits & HORIZONTAL or self.fuses_vision else self._vision_ns

    def _fuse_vision_position(self, measured_enu_m: F64, place_enu_m: F64, pose: ExternalPose) -> None:
        if self.fuses_gnss:
            raw = (measured_enu_m - place_enu_m) * LEVEL
            if self._bias_enu_m is None or pose.is_reset or not self.fuses_vision:
                self._bias_enu_m = raw
            if self.gnss.has_fix:
                self._bias_enu_m = self._bias_enu_m + BIAS_SHARE * (raw - self._bias_enu_m)
            else:
                self._follow(raw - self._bias_enu_m, pose)
            self.fuses_vision = True
            return
        apart = (measured_enu_m - place_enu_m) * LEVEL
        failing = self._now_ns - self._fused_ns > EV_FAILS_NS
        if self._bias_enu_m is not None or not self.fuses_vision or pose.is_reset or failing:
            self._bias_enu_m, self.fuses_vision = None, True
            self._filter.reset(POSITION, pose.error_m)
            self._reset_by(apart)
            self._fused_ns = self._now_ns
            self._steady = False
            return
        self._follow(apart, pose)

    def _follow(self, apart_enu_m: F64, pose: ExternalPose) -> None:
        self._ratio = self._filter.test_ratio(POSITION, apart_enu_m, pose.error_m, self.position_gate)
        if self._ratio < 1.0:
            self._correct(self._filter.gain(POSITION, pose.error_m), apart_enu_m, pose)
            self._since_s, self._fused_ns = 0.0, self._now_ns

    def _track_heading(self, apart_rad: float, pose: ExternalPose, bits: int) -> None:
        before = apart_rad if self._turn_rad is None or pose.is_reset else self._turn_rad
        self._turn_rad = before + BIAS_SHARE * math.remainder(apart_rad - before, 2 * math.pi)
        if self._fuses_heading(bits):
            self._heading.correct(apart_rad, pose.yaw_error_rad)

    def _turned(self, vector_enu: F64, bits: int) -> F64:
        """Return a vector of a frame with a heading of its own in the filter's axes."""
        if not self._odometry.is_turned or self._turn_rad is None or self._fuses_heading(bits):
            return vector_enu
        c, s = math.cos(self._turn_rad), math.sin(self._turn_rad)
        east, north, up = (float(v) for v in vector_enu)
        return np.array([c * east - s * north, s * east + c * north, up])

    # ---- reports ------------------------------------------------------------------------------------

    @property
    def flags(self) -> int:
        """Flags of ESTIMATOR_STATUS."""
        rejects = self.fuses_gnss and self.gnss.has_fix and self._ratio >= 1.0
        return (VALID if self.absolute else INVALID) | (mavlink.ESTIMATOR_GPS_GLITCH if rejects else 0)

    @property
    def stopped(self) -> bool:
        return False
