"""Who commands the vehicle, and to do what: survey, approach, descend, land, break off.

A state machine without I/O: `step` takes what is known now and returns what to do now. It commands nothing
before the operator handed over, and nothing after the mode changed under it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from companion.landing.choice import choose
from companion.landing.guidance import heading_rad, level, towards
from companion.landing.pattern import expanding_square
from params import Parameters
from slz import PointState, Report, SelectedPoint
from slz.pipeline import reach_m

Vector = NDArray[np.float64]


class Phase(Enum):
    """Where a landing stands."""

    IDLE = "idle"
    SURVEY = "survey"
    APPROACH = "approach"
    DESCEND = "descend"
    FINAL = "final"
    LANDED = "landed"
    CLIMB = "climb"
    HOLD = "hold"


FLYING = frozenset({Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL, Phase.CLIMB, Phase.HOLD})


class Severity(Enum):
    """Severities of MAVLink's STATUSTEXT that the executive uses."""

    CRITICAL = 2
    WARNING = 4
    NOTICE = 5
    INFO = 6


@dataclass(frozen=True, slots=True)
class Situation:
    """What is known now. Positions and velocities are east, north, up of the map frame.

    guided, landing: the autopilot's mode is the one that obeys us, or its landing mode. on_ground: None when
    the autopilot does not say. lidar_ok: scans arrive and are placed. report: the newest one, or None.
    """

    now_ns: int
    connected: bool
    armed: bool
    guided: bool
    landing: bool
    mode: str
    on_ground: bool | None
    position_enu_m: Vector | None
    velocity_enu_ms: Vector | None
    height_above_home_m: float
    lidar_ok: bool
    report: Report | None
    selected: SelectedPoint | None


@dataclass(frozen=True, slots=True)
class Orders:
    """What to do now.

    velocity_enu_ms: setpoint, or None to send none. yaw_rad: heading to turn to, or None to keep. mode:
    the kind of mode to ask for. target_enu_m: the landing target to stream. select_enu_m: a point to watch.
    """

    velocity_enu_ms: Vector | None = None
    yaw_rad: float | None = None
    mode: Literal["guided", "land"] | None = None
    target_enu_m: Vector | None = None
    select_enu_m: Vector | None = None
    texts: tuple[tuple[Severity, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer to an operator: accepted or not, and why."""

    accepted: bool
    reason: str


@dataclass(slots=True)
class Tally:
    """What happened so far, for the summary."""

    aborts: int = 0
    abort_reasons: list[str] = field(default_factory=list)
    hands_off: int = 0
    zone_id: int | None = None
    chosen_enu_m: Vector | None = None


STOPPED = np.zeros(3)


class Executive:
    """Landing executive.

    Parameters
    ----------
    parameters
        Speeds, heights and times of the `landing` section.
    auto
        Land without being asked, once the vehicle is armed, airborne and in its guided mode.
    """

    def __init__(self, parameters: Parameters, auto: bool) -> None:
        self._p = parameters
        self._auto = auto
        self.phase = Phase.IDLE
        self.tally = Tally()
        self._since_ns = 0
        self._steady_since_ns: int | None = None
        self._wish: Wish | None = None
        self._point: Vector | None = None
        self._refused: list[Vector] = []
        self._corners: Iterator[tuple[float, float]] | None = None
        self._corner: Vector | None = None
        self._height_m = 0.0
        self._safe_since_ns: int | None = None
        self._lost_since_ns: int | None = None
        self._guided_again = True
        self._texts: list[tuple[Severity, str]] = []
        self._pending_select: Vector | None = None

    # ---- operator -------------------------------------------------------------------------------

    def land_at_best(self, situation: Situation) -> Reply:
        """Take the order to land at the best zone."""
        return self._hand_over(situation, Wish())

    def land_in_zone(self, situation: Situation, zone_id: int) -> Reply:
        """Take the order to land in a zone by its ID."""
        zones = situation.report.zones if situation.report else ()
        zone = next((zone for zone in zones if zone.id == zone_id), None)
        if zone is None:
            return Reply(False, f"no zone {zone_id}")
        return self._hand_over(situation, Wish(zone.best.enu_m, zone_id))

    def land_at_point(self, situation: Situation, enu_m: Vector) -> Reply:
        """Take the order to land at a point of the operator's choice, if it proves safe."""
        return self._hand_over(situation, Wish(enu_m))

    def watch(self, enu_m: Vector) -> Reply:
        """Keep a point under watch without flying to it."""
        if self.phase in FLYING:
            return Reply(False, "busy landing: abort first")
        self._pending_select = enu_m
        return Reply(True, "watching the point")

    def abort(self, situation: Situation) -> Reply:
        """Break off and hover at survey height."""
        if self.phase not in FLYING:
            return Reply(False, "nothing to abort")
        if self.phase is Phase.FINAL and self._height_above_point(situation) < self._p.commit_height_m:
            return Reply(False, "below commit height: landing")
        self._wish = None
        self._break_off(situation, "operator", hold=True)
        return Reply(True, "aborting")

    def _hand_over(self, s: Situation, wish: Wish) -> Reply:
        if not s.connected:
            return Reply(False, "no autopilot")
        if not s.armed or s.on_ground is True:
            return Reply(False, "not flying")
        if not s.guided:
            return Reply(False, "set GUIDED first")
        if self.phase in (Phase.FINAL, Phase.DESCEND):
            return Reply(False, "descending: abort first")
        self._wish = wish
        self._refused.clear()
        self._start_survey(s)
        self._since_ns = s.now_ns - round(self._p.survey_s * 1e9)  # what was mapped so far will do
        return Reply(True, "landing")

    # ---- every step -----------------------------------------------------------------------------

    def step(self, s: Situation) -> Orders:
        """Return the orders of this moment (call it at 10 Hz or faster)."""
        orders = self._act(s)
        texts, self._texts = tuple(self._texts), []
        select, self._pending_select = self._pending_select, None
        if texts or select is not None:
            orders = Orders(
                orders.velocity_enu_ms, orders.yaw_rad, orders.mode, orders.target_enu_m, select, texts
            )
        return orders

    def _act(self, s: Situation) -> Orders:
        if self.phase in FLYING:
            if not s.armed or (s.on_ground is True and self.phase is Phase.FINAL):
                return self._finish(s)
            if s.connected and self._mode_changed(s):
                return self._hands_off(s)
            if s.position_enu_m is None or s.velocity_enu_ms is None:
                return self._without_pose(s)
        match self.phase:
            case Phase.IDLE | Phase.LANDED:
                return self._wait(s)
            case Phase.SURVEY:
                return self._survey(s)
            case Phase.APPROACH:
                return self._approach(s)
            case Phase.DESCEND:
                return self._descend(s)
            case Phase.FINAL:
                return self._final(s)
            case Phase.CLIMB | Phase.HOLD:
                return self._climb(s)

    def _mode_changed(self, s: Situation) -> bool:
        """Tell whether somebody else changed the mode.

        LAND in the final phase is ours, and so it stays after an abort until the autopilot has obeyed.
        """
        if s.guided:
            self._guided_again = True
            return False
        return not (s.landing and (self.phase is Phase.FINAL or not self._guided_again))

    def _hands_off(self, s: Situation) -> Orders:
        self._say(Severity.WARNING, f"pilot set {s.mode}: hands off")
        self.tally.hands_off += 1
        self._wish = None
        self._go(Phase.IDLE, s)
        return Orders()

    def _finish(self, s: Situation) -> Orders:
        landed = self.phase is Phase.FINAL
        self._say(Severity.NOTICE, "landed" if landed else "disarmed")
        self._go(Phase.LANDED if landed else Phase.IDLE, s)
        self._wish = None
        return Orders()

    # ---- phases ---------------------------------------------------------------------------------

    def _wait(self, s: Situation) -> Orders:
        """In auto mode start when the vehicle has been airborne, guided and level for two seconds."""
        steady = (
            self._auto
            and s.connected
            and s.armed
            and s.guided
            and s.on_ground is False
            and s.position_enu_m is not None
            and s.velocity_enu_ms is not None
            and abs(float(s.velocity_enu_ms[2])) < 0.3
            and s.height_above_home_m > min(5.0, self._p.survey_height_m)
        )
        if not steady:
            self._steady_since_ns = None
        elif self._steady_since_ns is None:
            self._steady_since_ns = s.now_ns
        elif s.now_ns - self._steady_since_ns > 2_000_000_000:
            self._refused.clear()
            self._wish = Wish()
            self._start_survey(s)
        return Orders()

    def _start_survey(self, s: Situation) -> None:
        if s.position_enu_m is None:
            self._say(Severity.WARNING, "no position: waiting")
        else:
            east, north, up = (float(v) for v in s.position_enu_m)
            self._height_m = up + max(0.0, self._p.survey_height_m - s.height_above_home_m)
            self._corners = expanding_square(east, north, 1.6 * reach_m(self._p))
            self._corner = np.array([east, north])
        self._say(Severity.INFO, "surveying")
        self._go(Phase.SURVEY, s)

    def _survey(self, s: Situation) -> Orders:
        position = _known(s.position_enu_m)
        if self._corner is None or self._corners is None:
            self._start_survey(s)
            return Orders(velocity_enu_ms=STOPPED)
        if not s.lidar_ok:
            return self._without_lidar(s)
        self._lost_since_ns = None
        wanted = self._p.survey_s * 1e9
        if self._wish is not None and self._wish.enu_m is not None:
            return self._approach_point(s, self._wish.enu_m, self._wish.zone_id)
        if s.now_ns - self._since_ns >= wanted and s.report is not None:
            zone = choose(s.report, self._refused, self._p)
            if zone is not None:
                return self._approach_point(s, zone.best.enu_m, zone.id)
        offset = self._corner - position[:2]
        if float(np.hypot(*offset)) < 3.0:
            self._corner = np.array(next(self._corners))
            offset = self._corner - position[:2]
        return self._fly(s, offset, self._p.survey_speed_ms, self._height_m)

    def _approach_point(self, s: Situation, enu_m: Vector, zone_id: int | None) -> Orders:
        self._point = np.asarray(enu_m, np.float64)
        self.tally.zone_id, self.tally.chosen_enu_m = zone_id, self._point
        self._pending_select = self._point
        self._safe_since_ns = None
        where = f"zone {zone_id}" if zone_id is not None else "the point"
        self._say(Severity.INFO, f"approaching {where}")
        self._go(Phase.APPROACH, s)
        return Orders(velocity_enu_ms=STOPPED)

    def _approach(self, s: Situation) -> Orders:
        """Fly over the point, and stay there until it was found safe for two seconds."""
        position, velocity, point = _known(s.position_enu_m), _known(s.velocity_enu_ms), _known(self._point)
        if not s.lidar_ok:
            return self._without_lidar(s)
        self._lost_since_ns = None
        judged = self._judgement(s)
        offset = point[:2] - position[:2]
        over = float(np.hypot(*offset)) < 1.0 and float(np.hypot(*velocity[:2])) < 0.5
        if judged is PointState.UNSAFE:
            self._break_off(s, "point unsafe")
            return Orders(velocity_enu_ms=STOPPED)
        if not (over and judged is PointState.SAFE):
            self._safe_since_ns = None
        elif self._safe_since_ns is None:
            self._safe_since_ns = s.now_ns
        elif s.now_ns - self._safe_since_ns > 2_000_000_000:
            self._say(Severity.INFO, "descending")
            self._go(Phase.DESCEND, s)
        if over and judged is PointState.UNKNOWN and s.now_ns - self._since_ns > 30_000_000_000:
            self._break_off(s, "point not seen")
        return self._fly(s, offset, self._p.approach_speed_ms, self._height_m)

    def _descend(self, s: Situation) -> Orders:
        """Sink over the point under watch, streaming the landing target, until LAND can take over."""
        position, point = _known(s.position_enu_m), _known(self._point)
        reason = self._why_not(s)
        if reason:
            self._break_off(s, reason)
            return Orders(velocity_enu_ms=STOPPED)
        offset = point[:2] - position[:2]
        distance = float(np.hypot(*offset))
        steady = s.now_ns - self._since_ns > 2_500_000_000
        if self._height_above_point(s) <= self._p.final_height_m and steady and distance < 0.7:
            self._say(Severity.INFO, "final: LAND")
            self._go(Phase.FINAL, s)
            return Orders(mode="land", target_enu_m=self._target(s))
        floor = self._p.final_height_m - 1.0 - self._height_above_point(s)
        sink = level(min(0.0, floor), self._p.descent_speed_ms) if distance < 1.5 else 0.0
        horizontal = towards(offset, self._p.approach_speed_ms)
        return Orders(velocity_enu_ms=np.array([*horizontal, sink]), target_enu_m=self._target(s))

    def _final(self, s: Situation) -> Orders:
        """Watch the autopilot land; above the commit height break off when the point turns unsafe."""
        if self._height_above_point(s) > self._p.commit_height_m:
            reason = self._why_not(s)
            if reason:
                self._break_off(s, reason)
                return Orders(mode="guided", velocity_enu_ms=np.array([0.0, 0.0, self._p.climb_speed_ms]))
        slow = s.guided and s.now_ns - self._since_ns > 1_000_000_000
        return Orders(mode="land" if slow else None, target_enu_m=self._target(s))

    def _climb(self, s: Situation) -> Orders:
        """After an abort: back to guided, up to survey height, then look again or wait for the operator."""
        position = _known(s.position_enu_m)
        if not s.guided:
            return Orders(mode="guided", velocity_enu_ms=np.array([0.0, 0.0, self._p.climb_speed_ms]))
        error = self._height_m - float(position[2])
        if error > 1.0:
            return Orders(velocity_enu_ms=np.array([0.0, 0.0, self._p.climb_speed_ms]))
        if self.phase is Phase.HOLD:
            return Orders(velocity_enu_ms=STOPPED)
        if not s.lidar_ok:
            return self._without_lidar(s)
        if s.now_ns - self._since_ns < 2_000_000_000:
            return Orders(velocity_enu_ms=STOPPED)
        self._say(Severity.INFO, "choosing again")
        if self._wish is not None:
            self._wish = Wish()
        self._go(Phase.SURVEY, s)
        self._since_ns = s.now_ns - round(self._p.survey_s * 1e9)
        return Orders(velocity_enu_ms=STOPPED)

    def _without_lidar(self, s: Situation) -> Orders:
        """Stop; after ten seconds tell the operator to take over."""
        if self._lost_since_ns is None:
            self._lost_since_ns = s.now_ns
            self._say(Severity.WARNING, "LiDAR lost: holding")
        elif s.now_ns - self._lost_since_ns > 10_000_000_000 and self.phase is not Phase.HOLD:
            self._say(Severity.CRITICAL, "LiDAR still lost: take over")
            self._go(Phase.HOLD, s)
        return Orders(velocity_enu_ms=STOPPED)

    def _without_pose(self, s: Situation) -> Orders:
        """Stop where the autopilot obeys velocities; once it lands by itself let it."""
        if not s.guided:
            return Orders(mode="guided" if not self._guided_again else None)
        return Orders(velocity_enu_ms=STOPPED)

    # ---- parts ----------------------------------------------------------------------------------

    def _fly(self, s: Situation, offset_m: Vector, speed_ms: float, height_m: float) -> Orders:
        position = _known(s.position_enu_m)
        climb = level(height_m - float(position[2]), self._p.climb_speed_ms)
        horizontal = towards(offset_m, speed_ms)
        yaw = heading_rad(horizontal) if float(np.hypot(*offset_m)) > 6.0 else None
        return Orders(velocity_enu_ms=np.array([*horizontal, climb]), yaw_rad=yaw)

    def _judgement(self, s: Situation) -> PointState:
        """State of our point in the newest report; unknown while that report is about another point.

        What the far map says is no ground to land on.
        """
        selected, point = s.selected, self._point
        if selected is None or point is None or float(np.hypot(*(selected.enu_m[:2] - point[:2]))) > 0.01:
            return PointState.UNKNOWN
        return PointState.UNKNOWN if selected.judged_by == "far" else selected.state

    def _why_not(self, s: Situation) -> str | None:
        """Return why the descent must not go on, or None."""
        if not s.lidar_ok:
            return "LiDAR lost"
        judged = self._judgement(s)
        return None if judged is PointState.SAFE else f"point {judged.value}"

    def _target(self, s: Situation) -> Vector:
        """The point on the ground as now measured."""
        point = _known(self._point)
        if s.selected is not None and np.isfinite(s.selected.height_m):
            return np.array([point[0], point[1], s.selected.height_m])
        return point

    def _height_above_point(self, s: Situation) -> float:
        if s.position_enu_m is None or self._point is None:
            return float("inf")
        return float(s.position_enu_m[2] - self._target(s)[2])

    def _break_off(self, s: Situation, reason: str, hold: bool = False) -> None:
        self.tally.aborts += 1
        self.tally.abort_reasons.append(reason)
        self._say(Severity.WARNING, f"abort: {reason}")
        if self._point is not None and not hold:
            self._refused.append(self._point)
        self._guided_again = self.phase is not Phase.FINAL
        self._go(Phase.HOLD if hold else Phase.CLIMB, s)

    def _go(self, phase: Phase, s: Situation) -> None:
        self.phase = phase
        self._since_ns = s.now_ns
        self._steady_since_ns = None

    def _say(self, severity: Severity, text: str) -> None:
        self._texts.append((severity, f"SLZ: {text}"))


@dataclass(frozen=True, slots=True)
class Wish:
    """What the operator asked for: a point, or None for the best zone."""

    enu_m: Vector | None = None
    zone_id: int | None = None


def _known(vector: Vector | None) -> Vector:
    if vector is None:
        raise RuntimeError("position unknown")
    return vector
