"""LiDAR odometry: scan to map in six degrees of freedom, with the autopilot's estimate as prior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.odometry.correction import Correction
from companion.flight.fusion.odometry.correction_filter import CorrectionFilter
from companion.flight.fusion.odometry.drift_track import DriftTrack
from companion.flight.fusion.odometry.gyro_track import GyroTrack
from companion.flight.fusion.odometry.odometry_estimate import SHARED_M, MapUncertainty, OdometryEstimate
from companion.flight.fusion.odometry.registration_kernel import normal_equations
from companion.flight.fusion.odometry.step_map import StepMap
from companion.flight.fusion.odometry.surfel_map import HOLD_NS, SIZES_M, SurfelMap
from companion.flight.fusion.pose_history import PoseHistory
from slz import Scan

Floats = NDArray[np.float64]
PERIOD_NS = 95_000_000  # of an update: 10 Hz of scans of 50 ms
GAP_NS = 2_000_000_000  # without scans, after which the map begins anew
MOST_POINTS = 24_000  # of an update, spread evenly over the scans
FEWEST_POINTS = 300
SIGMAS_M, GATE_M = (0.15, 0.07, 0.05, 0.05), 0.4  # of the rounds
# Points of a scan share errors, of pose and plane: so many count as one independent point.
SHARED = 10.0
STEPS_ROUND = 2  # of the rounds: height and tilt fit by then
LEAST_SHARE = 0.4  # of the points at a plane of the map, that lie in it
MOST_RATE_MS = 2.0  # of a drift
MOST_STEP_M, MOST_TURN_RAD = 0.15, np.radians(2.0)  # of one update, beside a drift
MOST_TILT_RAD = np.radians(4.0)
LOST_NS = 1_000_000_000  # without an axis, until the map no longer holds it
HEIGHT_AND_TILT = [0, 1, 5]  # of rotation vector and shift
UNSURE_M, UNSURE_RAD = 0.5, np.radians(2.0)  # of an axis that is not observed, beside the filter's covariance
VELOCITY_MS = 0.03  # standard deviation of a velocity beside its drift
FRESH_NS = 500_000_000
# Since the place was told, for which an autopilot's dead reckoning holds a landing: 0.15 m off.
BRIDGE_NS = 3_000_000_000
NEVER_NS = -(10**18)
STUCK = 20  # updates refused in a row, after which the map begins anew


class LidarOdometry:
    """Odometry of one LiDAR, which sets the history's correction.

    Parameters
    ----------
    history
        The autopilot's poses, which the correction moves to the map.
    gyro
        Rotations by the LiDAR's own gyroscope, if it has one: what the autopilot's heading turns beyond them
        is its error.
    gps_lost
        Returns whether the autopilot's receiver has lost its fix: a map that begins then is where an estimate
        without evidence has it, and determines no place until GPS is back.

    Attributes
    ----------
    name
        Name in texts to the pilot.
    updates, refused
        Updates by a scan, and scans that did not fit the map: too few points in its planes, or a step that no
        vehicle and no autopilot makes.
    restarts
        Times the map began anew.
    estimate
        Newest pose on the map; None before the second update, and while the autopilot's pose is stale.
    """

    name = "LiDAR"

    def __init__(
        self, history: PoseHistory, gyro: GyroTrack, gps_lost: Callable[[], bool] = lambda: False
    ) -> None:
        self.gyro = gyro
        self._history, self._gps_lost = history, gps_lost
        self._adrift = False  # the map began without GPS
        self._map, self._steps, self._filter = SurfelMap(), StepMap(), CorrectionFilter()
        self._unsure, self._map_variance_m2 = MapUncertainty(), np.zeros(3)
        self._waiting: list[Scan] = []
        self._last_ns: int | None = None
        self._epoch = history.epoch
        self._seen_ns = np.full(6, NEVER_NS)
        self._refused_in_row = 0
        self._drift = DriftTrack()
        self.estimate: OdometryEstimate | None = None
        self.updates = self.refused = self.restarts = 0

    def add(self, scan: Scan) -> None:
        """Take a scan as the autopilot's poses place it; update the correction once 0.1 s are complete."""
        if self._history.epoch != self._epoch:
            self._epoch = self._history.epoch
            self._restart()
        self._waiting.append(scan)
        newest_ns = int(scan.stamp_ns[-1])
        if self._last_ns is not None and newest_ns < self._last_ns:
            self._restart()
            return
        if newest_ns - int(self._waiting[0].stamp_ns[0]) < PERIOD_NS:
            return
        points = np.concatenate([one.points_enu_m for one in self._waiting])
        self._waiting = []
        if len(points) >= FEWEST_POINTS:
            step = -(-len(points) // MOST_POINTS)
            self._update(np.ascontiguousarray(points[::step]), scan.sensor_enu_m, newest_ns)

    def tells_place(self, now_ns: int) -> bool:
        """Return whether position and tilt are observable now."""
        estimate = self.estimate
        return estimate is not None and estimate.is_healthy and now_ns - estimate.stamp_ns < FRESH_NS

    def is_tracking(self, now_ns: int) -> bool:
        """Return whether height and tilt are observable now and the position was within 3 s."""
        estimate = self.estimate
        if estimate is None or now_ns - estimate.stamp_ns >= FRESH_NS:
            return False
        lost = estimate.stamp_ns - self._seen_ns[HEIGHT_AND_TILT] >= LOST_NS
        return not lost.any() and now_ns - int(self._seen_ns[3:5].min()) < BRIDGE_NS

    @property
    def gps_drift_m(self) -> float:
        """Distance by which the autopilot's position went off the map within the last ten seconds, m."""
        return self._drift.drift_m

    def statistics(self) -> dict[str, int]:
        """Return the counts."""
        return {"updates": self.updates, "refused": self.refused, "restarts": self.restarts}

    def _restart(self) -> None:
        """Begin the map anew; the correction stays."""
        self._map.clear()
        self._steps.clear()
        self._unsure.clear()
        self._map_variance_m2 = np.zeros(3)
        self._waiting, self._last_ns = [], None
        self._seen_ns[:] = NEVER_NS
        self._drift.clear()
        self._refused_in_row = 0
        self._filter = CorrectionFilter()
        self.estimate = self._history.tracked_until_ns = None
        self.restarts += 1

    def _update(self, points: Floats, sensor_enu_m: Floats, at_ns: int) -> None:
        correction = replace(self._history.correction, pivot_enu_m=sensor_enu_m)
        if self._last_ns is None or at_ns - self._last_ns > GAP_NS:
            if self._last_ns is not None:
                self._restart()
            self._last_ns, self._adrift = at_ns, self._gps_lost()
            placed = correction.points(points)
            self._map.add(placed, np.zeros(len(points), np.bool_), at_ns, sensor_enu_m)
            self._steps.add(placed, at_ns)
            self._unsure.add(at_ns, np.zeros(3))
            return
        seconds = (at_ns - self._last_ns) * 1e-9
        correction = replace(correction, turn_rad=correction.turn_rad + self._heading_error(at_ns))
        self._last_ns = at_ns
        predicted = self._filter.predict(
            np.concatenate([correction.turn_rad, correction.shift_enu_m, correction.rate_enu_ms]), seconds
        )
        state, fits, known, placed, age_ns = self._register(points, sensor_enu_m, at_ns, predicted, seconds)
        if not fits:
            self.refused += 1
            self._refused_in_row += 1
            self._set(predicted, sensor_enu_m, at_ns, np.zeros(6, np.bool_))
            if self._refused_in_row >= STUCK:
                self._restart()
            return
        self._refused_in_row = 0
        self.updates += 1
        observed = self._filter.observed.copy()
        self._adrift = self._adrift and self._gps_lost()
        observed[3:5] &= not self._adrift
        self._seen_ns[observed] = at_ns
        self._map_variance_m2 = self._unsure.variance_m2(at_ns - age_ns)
        self._unsure.add(at_ns, self._map_variance_m2 + np.diag(self._filter.covariance)[3:6] + SHARED_M**2)
        self._set(state, sensor_enu_m, at_ns, observed)
        self._map.add(placed, known, at_ns, sensor_enu_m + state[3:6])
        self._steps.add(placed, at_ns)

    def _heading_error(self, at_ns: int) -> Floats:
        """Return by how much the LiDAR turned more than the autopilot's heading since the last scan (3,)."""
        turned = self.gyro.rotation_between(self._last_ns or at_ns, at_ns)
        poses = self._history.interpolate(np.array([self._last_ns or at_ns, at_ns]))
        if turned is None or not poses.valid.all():
            return np.zeros(3)
        before, after = poses.rotation_enu_from_frd
        error = Rotation.from_matrix(before @ turned @ after.T).as_rotvec()
        return np.array([0.0, 0.0, error[2]])

    def _register(
        self, points: Floats, pivot: Floats, at_ns: int, predicted: Floats, seconds: float
    ) -> tuple[Floats, bool, NDArray[np.bool_], Floats, int]:
        """Return state, whether scan and map agree, points that the map knows, points on it, and its age."""
        state, surfels = predicted.copy(), self._map
        placed, known = np.empty_like(points), np.empty(len(points), np.bool_)
        left, right = np.zeros((6, 6)), np.zeros(6)
        met = matched = walls = steep = age_ns = 0
        target, information, near_steps = np.zeros(2), np.zeros((2, 2)), 0
        for number, sigma_m in enumerate(SIGMAS_M):
            met, matched, walls, steep, age_ns = normal_equations(
                points,
                pivot,
                Correction(state[:3]).rotation,
                state[3:6],
                at_ns,
                SIZES_M,
                surfels.keys,
                surfels.first_ns,
                surfels.counts,
                surfels.planes,
                HOLD_NS,
                sigma_m,
                GATE_M,
                placed,
                known,
                left,
                right,
            )
            steep *= steep >= LEAST_SHARE * walls  # else the map is beside the scan
            left /= SHARED
            right /= SHARED
            if number == STEPS_ROUND:
                shift, information, near_steps = self._steps.shift(placed, pivot + state[3:6], at_ns)
                target = state[3:5] + shift
            left[3:5, 3:5] += information
            right[3:5] += information @ (target - state[3:5])
            steep += near_steps
            state[:6] += self._filter.change(state[:6] - predicted[:6], left, right, steep)
        moved = state[:6] - predicted[:6]
        fits = (
            matched >= LEAST_SHARE * met
            and float(np.linalg.norm(moved[3:])) <= MOST_STEP_M + MOST_RATE_MS * seconds
            and float(np.linalg.norm(moved[:3])) <= MOST_TURN_RAD
            and float(np.linalg.norm(state[:2])) <= MOST_TILT_RAD
        )
        if fits:
            state[6:] += self._filter.finish(moved, left, steep)
            state[6:] = self._filter.known_rates(state[6:])  # the rest goes on as the autopilot has it
        return state, bool(fits), known, placed, age_ns

    def _set(self, state: Floats, pivot_enu_m: Floats, at_ns: int, observed: NDArray[np.bool_]) -> None:
        """Hand the correction to the history, and form the estimate with the axes that this scan observes.

        An axis that it does not observe is the autopilot's own: stated as observed, it would confirm itself.
        """
        held = at_ns - self._seen_ns < LOST_NS
        self._drift.add(at_ns, state[3:5], bool(held[3:5].all()))
        slide_up_ms = self._history.correction.slide_up_ms
        self._history.correction = Correction(state[:3], pivot_enu_m, state[3:6], state[6:], slide_up_ms)
        self._history.tracked_until_ns = at_ns + LOST_NS if held.all() else None
        pose = self._history.at(at_ns)
        if pose is None:
            self.estimate = None
            return
        order = [3, 4, 5, 0, 1, 2]
        unsure = np.where(observed, 0.0, [UNSURE_RAD**2] * 3 + [UNSURE_M**2] * 3)
        unsure[3:] += self._map_variance_m2 + SHARED_M**2
        self.estimate = OdometryEstimate(
            stamp_ns=pose.stamp_ns,
            position_enu_m=pose.position_enu_m,
            velocity_enu_ms=pose.velocity_enu_ms,
            quat_wxyz=pose.quat_wxyz,
            pose_covariance=self._filter.covariance[np.ix_(order, order)] + np.diag(unsure[order]),
            velocity_covariance=self._filter.covariance[6:, 6:] + np.eye(3) * VELOCITY_MS**2,
            observed=observed[order],
            resets=self.restarts,
        )
