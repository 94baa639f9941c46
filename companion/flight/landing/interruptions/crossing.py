"""Moving objects over the point: a wait while people cross it, and breaking off for what stays.

People, dogs and balls pass; vehicles may stop, so that the landing is broken off for them at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from companion.flight.landing.aim import Aim, committed_m
from companion.flight.landing.point_objections import objection
from companion.flight.landing.situation import (
    STOPPED,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
)
from companion.flight.landing.transitions import SECOND, LandingCore
from companion.flight.landing.ways.endurance import is_battery_low
from params import Parameters
from slz import MovingObject

SLOWEST_MS, FASTEST_MS = 0.5, 1.5  # sink rates of autopilots at the end of a landing
LONGEST_S = 10.0  # ahead; who moves does not keep a course for longer
BEFORE_S, AFTER_S = 1.0, 2.0  # around the touchdown, in which nothing may be there
DECIDED_M = 3.0  # above the height at which the landing is committed: earlier there is time to go on looking
SHOWN_S = 2.5  # after somebody left, until which the newest map may show him there: a window and its time
PERSON_M = 1.0  # radius of returns up to which an object may be a person
PERSON_BERTH_M, BERTH_M = 1.5, 0.7  # beside the footprint; people move as they like
PERSON_HEIGHT_M = 1.2, 2.2
SMALL_M = 0.7  # radius of the returns of what is waited for
LEAST_HEIGHT_M, OVER_HEAD_M = 3.0, 2.0  # over the point and over who crosses, for a wait; lower, it climbs
FREE_NS = SECOND  # nobody crosses, before the landing goes on
GIVEN_BACK_NS = 12 * SECOND  # after somebody left, until which the map must show point and way in safe again
LONGEST_NS = 20 * SECOND
MOST_NS = 60 * SECOND  # of all waits of a landing
KNOWN_NS = 2 * SECOND  # for which an object goes on as it did, whose track was lost
MARGIN_S = 1.0  # s, added to the time that the pilot reads
MOST_GIVEN = 3  # landings on a point that are broken off for moving objects, before another point is taken


class CrossingWait:
    """Hover over the point, in the descent or the autopilot's landing, while somebody crosses."""

    def __init__(self, core: LandingCore) -> None:
        self._p, self._progress, self._texts, self._transitions = core
        self._since_ns: int | None = None
        self._crossed_ns = 0  # last time at which somebody was crossing
        self._asked_ns = 0
        self._landing_ns: int | None = None  # when the landing was ordered
        self._waited_ns = 0
        self._known: dict[int, MovingObject] = {}

    @property
    def is_on(self) -> bool:
        """True if the vehicle waits."""
        return self._since_ns is not None

    def reset(self) -> None:
        """End the wait."""
        self._since_ns = None

    def commands(self, s: Situation) -> VehicleCommands | None:
        """Return the commands of a wait; None where the landing goes on, or must be broken off."""
        progress, p = self._progress, self._p
        self._follow(s)
        crossers = self._crossers(s)
        highest_m = max((one.height_m for one in crossers), default=0.0)
        low = progress.aim.height_left_m < max(LEAST_HEIGHT_M, highest_m + OVER_HEAD_M)
        hurried = progress.is_urgent or is_battery_low(s, p) or self._waited_ns > MOST_NS
        large = any(one.radius_m >= SMALL_M for one in crossers)
        if low or large or hurried or not s.lidar_ok or progress.path is not None:
            self.reset()
            return None
        if crossers and self._since_ns is None:
            self._since_ns = s.now_ns
            one = max(crossers, key=lambda other: leaves_after_s(other, s, progress.aim, p))
            seconds = leaves_after_s(one, s, progress.aim, p) + MARGIN_S
            self._texts.say(Severity.NOTICE, f"{name(one)} crossing: waiting {seconds:.0f} s")
        if self._since_ns is None:
            return None
        if crossers:
            self._crossed_ns = s.now_ns
        if self._is_over(s):
            self.reset()
            self._transitions.restart_limit(s)
            return None
        if progress.phase is Phase.FINAL:
            self._transitions.enter_phase(Phase.DESCEND, s)
        self._transitions.restart_limit(s)
        held = VehicleCommands(velocity_enu_ms=STOPPED, target_enu_m=progress.aim.on_ground_enu_m)
        return held if s.guided else replace(held, mode="guided")

    def give_way(self, s: Situation) -> VehicleCommands | None:
        """Break the landing off for what will be at the point at the touchdown; None without it.

        The same point is tried again, after `MOST_GIVEN` times another one. An urgent landing and one with a
        low battery give way once.
        """
        progress = self._progress
        coming = crossing(s, progress.aim, self._p)
        cannot_wait = progress.is_urgent or is_battery_low(s, self._p)
        if not coming or (cannot_wait and progress.n_given):
            return None
        progress.n_given += 1
        keeps_point = progress.n_given % MOST_GIVEN != 0
        return self._transitions.break_off(
            f"object of {coming[0].height_m:.1f} m moves in", s, keeps_point=keeps_point
        )

    def _follow(self, s: Situation) -> None:
        """Sum up the time waited in this landing; a wait of another descent is over."""
        since_asked_ns = s.now_ns - self._asked_ns
        if since_asked_ns > SECOND:
            self.reset()
        if self._landing_ns != self._progress.started_ns:
            self._landing_ns, self._waited_ns = self._progress.started_ns, 0
        if self._since_ns is not None:
            self._waited_ns += since_asked_ns
        self._asked_ns = s.now_ns
        seen = self._known | {one.number: one for one in s.moving}
        self._known = {number: one for number, one in seen.items() if s.now_ns - one.stamp_ns < KNOWN_NS}

    def _crossers(self, s: Situation) -> tuple[MovingObject, ...]:
        aim, p = self._progress.aim, self._p
        coming = crossing(s, aim, p)
        if objection(s, self._progress, self._p) is not None:  # it may be they that the map shows
            return *coming, *lately_on_the_point(self._known.values(), s, aim, p)
        return (*coming, *on_the_point(s, aim, p)) if self.is_on else coming

    def _is_over(self, s: Situation) -> bool:
        """Return whether the landing goes on, or something else must be done about the point."""
        if s.now_ns - (self._since_ns or 0) > LONGEST_NS:
            return True
        free_ns = s.now_ns - self._crossed_ns
        return free_ns > GIVEN_BACK_NS or (
            free_ns > FREE_NS and objection(s, self._progress, self._p) is None
        )


def crossing(s: Situation, aim: Aim, parameters: Parameters) -> tuple[MovingObject, ...]:
    """Return the objects that will be at the point at the touchdown, if they keep their course.

    Asked only shortly before the landing is committed: what crosses before is gone by then.
    """
    p = parameters
    if aim.enu_m is None or not 0 <= aim.height_left_m <= committed_m(p) + DECIDED_M:
        return ()
    from_s = max(0.0, aim.height_left_m / FASTEST_MS - BEFORE_S)
    until_s = min(LONGEST_S, aim.height_left_m / SLOWEST_MS + AFTER_S)
    return _within_berth(s.moving, s, aim, p, from_s, until_s)


def is_clear_of(
    moving: Iterable[MovingObject], now_ns: int, point_enu_m: Vector, parameters: Parameters
) -> bool:
    """Return whether nobody is, or soon will be, at a place, if they keep their course."""
    until_ns = now_ns + round(LONGEST_S * 1e9)
    return all(
        one.nearest(point_enu_m[:2], now_ns, until_ns)[0] >= _berth_m(one, parameters) for one in moving
    )


def on_the_point(s: Situation, aim: Aim, parameters: Parameters) -> tuple[MovingObject, ...]:
    """Return the objects that move over the point now."""
    return _within_berth(s.moving, s, aim, parameters, 0.0, 0.0)


def lately_on_the_point(
    known: Iterable[MovingObject], s: Situation, aim: Aim, parameters: Parameters
) -> tuple[MovingObject, ...]:
    """Return which objects move over the point, or did so when the newest map was measured."""
    return _within_berth(known, s, aim, parameters, -SHOWN_S, 0.0)


def leaves_after_s(one: MovingObject, s: Situation, aim: Aim, parameters: Parameters) -> float:
    """Return the time until an object has left the point with its berth, if it keeps its course (s)."""
    if aim.enu_m is None:
        return 0.0
    start, velocity = one.at(s.now_ns) - aim.enu_m[:2], one.velocity_ms
    speed2, along = float(velocity @ velocity), float(start @ velocity)
    within = along**2 - speed2 * (float(start @ start) - _berth_m(one, parameters) ** 2)
    return 0.0 if speed2 == 0 or within < 0 else max(0.0, (math.sqrt(within) - along) / speed2)


def name(one: MovingObject) -> str:
    """Return a person, or an object of a height, in the pilot's words."""
    low_m, high_m = PERSON_HEIGHT_M
    is_person = one.radius_m < PERSON_M and low_m <= one.height_m <= high_m
    return "person" if is_person else f"object of {one.height_m:.1f} m"


def _within_berth(
    moving: Iterable[MovingObject],
    s: Situation,
    aim: Aim,
    parameters: Parameters,
    from_s: float,
    until_s: float,
) -> tuple[MovingObject, ...]:
    if aim.enu_m is None:
        return ()
    point, times = aim.enu_m[:2], (s.now_ns + round(from_s * 1e9), s.now_ns + round(until_s * 1e9))
    return tuple(one for one in moving if one.nearest(point, *times)[0] < _berth_m(one, parameters))


def _berth_m(one: MovingObject, parameters: Parameters) -> float:
    """Return how far from the point the middle of an object must be (m)."""
    p = parameters
    berth_m = PERSON_BERTH_M if one.radius_m < PERSON_M else BERTH_M
    return max(p.footprint_m, p.greatest_dimension_m) / 2 + one.radius_m + berth_m
