"""External odometry as source of the place: its poses, aligned to the map, correct the autopilot's."""

from __future__ import annotations

import logging
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.external_pose import Drop, ExternalPose, PosePair
from companion.flight.fusion.external_odometry.frame_alignment import AlignedFrame, AlignmentSearch
from companion.flight.fusion.external_odometry.odometry_topic import ChildFrame
from companion.flight.fusion.external_odometry.shift_filter import RATE, SHIFT, YAW, ShiftFilter
from companion.flight.fusion.odometry.correction import Correction
from companion.flight.fusion.odometry.drift_track import DriftTrack
from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.axes import quaternion_wxyz
from slz import Scan

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]

STEP_NS = 19_000_000  # of the poses in use: 50 Hz at most
GAP_NS = 2_000_000_000  # without poses, after which the place in the odometry's frame is taken anew
LOST_NS = 1_000_000_000  # without poses, after which the autopilot's own estimate goes on
FRESH_NS = 500_000_000
BRIDGE_NS = 3_000_000_000  # as for the LiDAR odometry: an autopilot's dead reckoning is 0.15 m off by then
LEAD_NS = 300_000_000  # a scan is placed by a correction at most so much older
MOST_WAITING = 100
# Of one step, beside a drift: as of the LiDAR odometry.
MOST_STEP_M, MOST_STEP_RAD = 0.15, np.radians(3.0)
# Rate at which it may part from the autopilot: without GPS this drifts ever faster. With GPS, an odometry
# that slides (a LiDAR's over level ground) is likelier than a GPS that does.
MOST_RATE_MS, MOST_RATE_WITH_GPS_MS = 2.0, 0.5
# A barometer is not so wrong: the odometry knows no height, as that of wheels.
MOST_RATE_UP_MS = 0.3
MOST_PARTINGS = 2  # after which it is not used again before its frame or publisher changes
MOST_TILT_RAD = np.radians(4.0)
TILT_S = 20.0  # in which the frame is levelled by the autopilot's attitude
MOST_JUMPS, JUMPS_NS = 3, 10_000_000_000
REASON_NS = 1_000_000_000
SILENT, PARTS = "silent", "parts from the autopilot"
VELOCITY_MS = 0.05  # standard deviation of a velocity beside its drift
WAY_SHARE = 0.005  # drift of an odometry that states no covariance, of its way


class ExternalOdometry:
    """Odometry of another program, which sets the history's correction.

    It gives position and heading, as far as they go off the autopilot's since the alignment. Roll and pitch
    stay the autopilot's, which are those of gravity. Without poses the last correction stays.

    Parameters
    ----------
    history
        The autopilot's poses, which the correction moves to the map.
    child
        Child frame of the odometry on the vehicle.
    gps_lost
        Returns whether the autopilot's receiver has lost its fix.

    Attributes
    ----------
    name
        Name in texts to the pilot.
    drops
        Messages that were not used, by reason.
    updates
        Poses in use.
    alignments, jumps, restarts
        Alignments of the frame to the map; jumps of the odometry in position, and changes of its frame,
        heading or publisher after which it was aligned anew.
    autopilot_steps
        Steps of the autopilot's estimate that the odometry did not make.
    estimate
        Newest pose on the map, None before the first.
    """

    name = "odometry"

    def __init__(self, history: PoseHistory, child: ChildFrame, gps_lost: Callable[[], bool]) -> None:
        self._history, self._child, self._gps_lost = history, child, gps_lost
        self._waiting: deque[ExternalPose] = deque()
        self._search = AlignmentSearch()
        self._frame: AlignedFrame | None = None
        self._filter = ShiftFilter(0.0, np.zeros(3), 0.0)
        self._origin: tuple[str, str, str] | None = None
        self._epoch = history.epoch
        self._set = history.correction
        self._last: PosePair | None = None
        self._arrived_ns: int | None = None
        self._rejoins = False
        self._not_before_ns = 0
        self._resets = self._partings = 0
        self._way_m = 0.0
        self._drift = DriftTrack()
        self._jumped_ns: deque[int] = deque()
        self._reason, self._reason_ns = "", 0
        self.drops: Counter[Drop] = Counter()
        self.updates = self.alignments = self.jumps = self.restarts = self.autopilot_steps = 0
        self.estimate: OdometryEstimate | None = None

    # ---- what comes in --------------------------------------------------------------------------

    def add_pose(self, pose: ExternalPose) -> None:
        """Take a pose on the companion's clock; it waits until the autopilot's poses bracket it."""
        self._arrived_ns = pose.stamp_ns
        self._waiting.append(pose)
        if len(self._waiting) > MOST_WAITING:
            self._drop(Drop.WITHOUT_POSE, self._waiting.popleft().stamp_ns)
        self._use_bracketed()

    def on_drop(self, reason: Drop, at_ns: int) -> None:
        """Note a message that is not used."""
        self._drop(reason, at_ns)

    def add(self, scan: Scan) -> None:
        """Bring the correction up to a scan that is about to be placed."""
        self._use_bracketed()
        if self._last is not None:
            self._correct(int(scan.stamp_ns[-1]), self._last)

    # ---- what is known --------------------------------------------------------------------------

    def tells_place(self, now_ns: int) -> bool:
        """Return whether the odometry determines the place now."""
        return self._used_within(FRESH_NS, now_ns)

    def is_tracking(self, now_ns: int) -> bool:
        """Return whether the odometry determined the place within three seconds."""
        return self._used_within(BRIDGE_NS, now_ns)

    def why_not(self, now_ns: int) -> str:
        """Return why the odometry is not used now, in at most 26 characters; empty while it is."""
        if self.tells_place(now_ns):
            return ""
        if self._partings >= MOST_PARTINGS:
            return PARTS
        if self._reason and now_ns - self._reason_ns < REASON_NS:
            return self._reason
        if self._arrived_ns is None or now_ns - self._arrived_ns >= LOST_NS:
            return SILENT
        return self._search.reason

    @property
    def gps_drift_m(self) -> float:
        """Distance by which the autopilot's position went off the map within the last ten seconds, m."""
        return self._drift.drift_m

    def statistics(self) -> dict[str, int]:
        """Return the counts."""
        return {
            "updates": self.updates,
            "alignments": self.alignments,
            "jumps": self.jumps,
            "restarts": self.restarts,
            "autopilot_steps": self.autopilot_steps,
            **{reason.counter: self.drops[reason] for reason in Drop},
        }

    # ---- poses ----------------------------------------------------------------------------------

    def _use_bracketed(self) -> None:
        self._follow_history()
        until_ns = self._history.bracketed_until_ns
        while until_ns is not None and self._waiting and self._waiting[0].stamp_ns <= until_ns:
            self._use(self._waiting.popleft())

    def _use(self, pose: ExternalPose) -> None:
        at_ns, last = pose.stamp_ns, self._last
        if last is not None and pose.origin == self._origin and at_ns - last.at_ns < STEP_NS:
            self.drops[Drop.THINNED] += 1
            return
        poses = self._history.interpolate(np.array([at_ns]))
        # Before a jump that the history has absorbed, the autopilot's poses are of other coordinates.
        early = at_ns <= self._not_before_ns
        if early or not poses.valid[0] or self._history.correction_at(at_ns) is not self._history.correction:
            self._drop(Drop.WITHOUT_POSE, at_ns)
            return
        place_m, rotation = poses.position_enu_m[0], poses.rotation_enu_from_frd[0]
        pair = PosePair(at_ns, place_m, rotation, *self._child.vehicle(pose), pose.is_stated)
        if pose.origin != self._origin:
            if self._origin is not None:
                self._begin_anew("another frame", at_ns)
            self._origin, self._partings = pose.origin, 0
        elif last is not None and at_ns - last.at_ns > GAP_NS:
            self._rejoin()
        if self._partings >= MOST_PARTINGS:
            return
        if self._frame is None or last is None:
            self._seek(pair)
        else:
            self._follow(pair, last, self._frame)
        self._last = pair

    def _seek(self, pair: PosePair) -> None:
        """Search the alignment to the map, on which the last correction holds."""
        on_map = self._history.correction
        found = self._search.add(pair, on_map)
        if found is None:
            return
        self._frame = AlignedFrame(found, pair)
        self.alignments += 1
        self._filter = ShiftFilter(float(on_map.turn_rad[2]), on_map.shift_enu_m, found.sigma_rad)
        self._way_m = 0.0
        log.info("the odometry is aligned: its heading is %.1f deg off", np.degrees(found.heading_rad))

    def _follow(self, pair: PosePair, last: PosePair, frame: AlignedFrame) -> None:
        """Correct the autopilot's error by a pose, or say why it is not."""
        filter_, seconds = self._filter, (pair.at_ns - last.at_ns) * 1e-9
        filter_.predict(seconds)
        turn = frame.turn_rad(pair)
        heading_rad = float(turn[2]) - frame.heading_rad - float(filter_.state[YAW])
        heading_rad = (heading_rad + np.pi) % (2 * np.pi) - np.pi
        if np.linalg.norm(turn[:2]) > MOST_TILT_RAD:
            self._begin_anew("attitude not the vehicle's", pair.at_ns)
        elif abs(heading_rad) > MOST_STEP_RAD:
            self._begin_anew("heading jumped", pair.at_ns)
        elif self._explain_step(pair, last, frame):
            self._update(pair, frame, heading_rad)
            self._way_m += float(np.linalg.norm(pair.stated_m - last.stated_m))
            frame.level(pair, min(1.0, seconds / TILT_S))

    def _update(self, pair: PosePair, frame: AlignedFrame, heading_rad: float) -> None:
        """Take a pose whose heading errs by so much more than the state says."""
        filter_, gps = self._filter, not self._gps_lost()
        measured = np.append(heading_rad + filter_.state[YAW], frame.place_m(pair) - pair.auto_m)
        frame.turn_back(filter_.update(measured, frame.way_m(pair), learns=gps))
        partings = self._parts(gps)
        if partings:
            self._partings += partings
            self._begin_anew(PARTS, pair.at_ns)
            return
        self.updates += 1
        self._history.tracked_until_ns = pair.at_ns + LOST_NS
        self._drift.add(pair.at_ns, filter_.state[SHIFT][:2], True)
        self._correct(pair.at_ns, pair)
        self._estimate(pair, frame)

    def _explain_step(self, pair: PosePair, last: PosePair, frame: AlignedFrame) -> bool:
        """Follow a step of the autopilot or of the odometry; return False if that jumps too often."""
        filter_, seconds = self._filter, (pair.at_ns - last.at_ns) * 1e-9
        if self._rejoins:
            self._rejoins = False
            frame.move(pair.auto_m + filter_.state[SHIFT] - frame.place_m(pair))
            return True
        auto_m = pair.auto_m - last.auto_m
        step_m = frame.place_m(pair) - frame.place_m(last) - auto_m - filter_.state[RATE] * seconds
        if np.linalg.norm(step_m) <= MOST_STEP_M + MOST_RATE_MS * seconds:
            return True
        velocities_ms = [self._history.velocity_enu_ms(at_ns) for at_ns in (last.at_ns, pair.at_ns)]
        auto_step_m = auto_m - np.mean(velocities_ms, axis=0) * seconds
        if np.linalg.norm(step_m + auto_step_m) < np.linalg.norm(step_m) / 2:
            self.autopilot_steps += 1
            filter_.state[SHIFT] += step_m
            return True
        self.jumps += 1
        log.warning("the odometry jumped by %.1f m", float(np.linalg.norm(step_m)))
        self._jumped_ns.append(pair.at_ns)
        while pair.at_ns - self._jumped_ns[0] > JUMPS_NS:
            self._jumped_ns.popleft()
        if len(self._jumped_ns) > MOST_JUMPS:
            self._begin_anew("jumps again and again", pair.at_ns)
            return False
        frame.move(-step_m)
        return True

    def _parts(self, gps: bool) -> int:
        """Return how often odometry and autopilot have parted now: faster than either errs.

        An odometry that parts in height knows none, and has parted once and for all.
        """
        rate_ms = self._filter.state[RATE]
        if abs(float(rate_ms[2])) > MOST_RATE_UP_MS:
            return MOST_PARTINGS
        limit_ms = MOST_RATE_WITH_GPS_MS if gps else MOST_RATE_MS
        return int(np.linalg.norm(rate_ms[:2]) > limit_ms)

    def _rejoin(self) -> None:
        """Take the place in the odometry's frame anew with the next pose: the one on the map stays."""
        self._rejoins = True
        self._resets += 1
        self._filter.state[RATE] = 0.0
        self._drift.clear()

    def _begin_anew(self, reason: str, at_ns: int) -> None:
        """Align anew; the correction stays."""
        if self._frame is not None:
            self.restarts += 1
            self._resets += 1
            log.warning("the odometry is aligned anew: %s", reason)
        self._search, self._frame = AlignmentSearch(), None
        self._filter.state[RATE] = 0.0
        self._rejoins = False
        self._jumped_ns.clear()
        self._drift.clear()
        self._history.tracked_until_ns = None
        self.estimate = None
        self._reason, self._reason_ns = reason, at_ns
        if self._last is not None:
            self._correct(at_ns, self._last)

    # ---- correction and estimate ----------------------------------------------------------------

    def _follow_history(self) -> None:
        """Follow what the history did to the correction: a new map, or a jump that it absorbed."""
        history, filter_ = self._history, self._filter
        if history.epoch != self._epoch:
            self._epoch = history.epoch
            self._not_before_ns = history.bracketed_until_ns or 0
            self._search = AlignmentSearch()
            if self._frame is not None:
                self._frame.heading_rad += float(filter_.state[YAW])
                self._rejoin()
            filter_.state[:] = 0.0
        elif history.correction is not self._set and self._last is not None:
            moved_m = history.correction.shift_enu_m - self._set.shift_enu_m
            filter_.state[SHIFT] += moved_m
            auto_m = self._last.auto_m - history.correction.rotation.T @ moved_m
            self._last = replace(self._last, auto_m=auto_m)
        self._set = history.correction

    def _correct(self, at_ns: int, last: PosePair) -> None:
        """Set the correction for a time: that of the last pose, moved on by its rate while that is known."""
        state, since_ns = self._filter.state, at_ns - last.at_ns
        known = self._frame is not None and since_ns < LOST_NS
        lead_s = 0.0 if self._frame is None else min(max(since_ns, -LEAD_NS), LEAD_NS) * 1e-9
        if not known:
            self._drift.clear()
        poses = self._history.interpolate(np.array([at_ns]))
        pivot_m = poses.position_enu_m[0] if poses.valid[0] else self._history.correction.pivot_enu_m
        self._set = self._history.correction = Correction(
            np.array([0.0, 0.0, state[YAW]]),
            pivot_m,
            state[SHIFT] + state[RATE] * lead_s,
            state[RATE] if known else np.zeros(3),
            self._history.correction.slide_up_ms,
        )

    def _estimate(self, pair: PosePair, frame: AlignedFrame) -> None:
        correction = self._history.correction
        autopilot_ms = self._history.velocity_enu_ms(pair.at_ns)
        velocity_ms = correction.rotation @ autopilot_ms + correction.rate_enu_ms
        self.estimate = external_estimate(
            pair, self._filter, frame.rotation, velocity_ms, self._way_m, self._resets
        )

    # ---- parts ----------------------------------------------------------------------------------

    def _used_within(self, limit_ns: int, now_ns: int) -> bool:
        return self.estimate is not None and now_ns - self.estimate.stamp_ns < limit_ns

    def _drop(self, reason: Drop, at_ns: int) -> None:
        self.drops[reason] += 1
        if reason is not Drop.FOREIGN:
            self._reason, self._reason_ns = reason.words, at_ns


def external_estimate(
    pair: PosePair,
    filtered: ShiftFilter,
    rotation_map_from_odometry: Floats,
    velocity_enu_ms: Floats,
    way_m: float,
    resets: int,
) -> OdometryEstimate:
    """Return the estimate at the time of a pose; all axes are observed.

    Parameters
    ----------
    filtered
        Error of the autopilot's pose.
    velocity_enu_ms
        Of the vehicle on the map, (3,).
    way_m
        Flown since the alignment.
    """
    state, errors = filtered.state, filtered.covariance
    body = Rotation.from_rotvec([0.0, 0.0, state[YAW]]).as_matrix() @ pair.auto
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation_map_from_odometry
    covariance = turn @ pair.covariance @ turn.T
    covariance[:3, :3] += errors[SHIFT, SHIFT]
    covariance[5, 5] += errors[YAW, YAW]
    if not pair.is_stated:
        covariance[:3, :3] += np.eye(3) * (WAY_SHARE * way_m) ** 2
    return OdometryEstimate(
        stamp_ns=pair.at_ns,
        position_enu_m=pair.auto_m + state[SHIFT],
        velocity_enu_ms=velocity_enu_ms,
        quat_wxyz=quaternion_wxyz(body),
        pose_covariance=covariance,
        velocity_covariance=errors[RATE, RATE] + np.eye(3) * VELOCITY_MS**2,
        observed=np.ones(6, np.bool_),
        resets=resets,
    )
