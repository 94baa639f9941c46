"""Objects that move over the point: who will be there at the touchdown, and who is there now."""

from __future__ import annotations

import math
from collections.abc import Iterable

from companion.flight.landing.aim import Aim
from companion.flight.landing.situation import Situation
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


def crossing(s: Situation, aim: Aim, parameters: Parameters) -> tuple[MovingObject, ...]:
    """Return the objects that will be at the point at the touchdown, if they keep their course.

    Asked only shortly before the landing is committed: what crosses before is gone by then.
    """
    p = parameters
    committed_m = max(p.commit_height_m, p.dust_height_m)
    if aim.enu_m is None or not 0 <= aim.height_left_m <= committed_m + DECIDED_M:
        return ()
    from_s = max(0.0, aim.height_left_m / FASTEST_MS - BEFORE_S)
    until_s = min(LONGEST_S, aim.height_left_m / SLOWEST_MS + AFTER_S)
    return _within_berth(s.moving, s, aim, p, from_s, until_s)


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
