"""Objects that will be at the point when the vehicle touches down."""

from __future__ import annotations

from companion.flight.landing.aim import Aim
from companion.flight.landing.situation import Situation
from params import Parameters
from slz import MovingObject

SLOWEST_MS, FASTEST_MS = 0.5, 1.5  # sink rates of autopilots at the end of a landing
LONGEST_S = 10.0  # ahead; who moves does not keep a course for longer
BEFORE_S, AFTER_S = 1.0, 2.0  # around the touchdown, in which nothing may be there
DECIDED_M = 3.0  # above the height at which the landing is committed: earlier there is time to go on looking
PERSON_M = 1.0  # radius of returns up to which an object may be a person
PERSON_BERTH_M, BERTH_M = 1.5, 0.7  # beside the footprint; people move as they like


def crossing(s: Situation, aim: Aim, parameters: Parameters) -> MovingObject | None:
    """Return an object that will be at the point at the touchdown, if it keeps its course, or None.

    Asked only shortly before the landing is committed: what crosses before is gone by then.
    """
    p = parameters
    committed_m = max(p.commit_height_m, p.dust_height_m)
    if aim.enu_m is None or not 0 <= aim.height_left_m <= committed_m + DECIDED_M:
        return None
    from_s = max(0.0, aim.height_left_m / FASTEST_MS - BEFORE_S)
    until_s = min(LONGEST_S, aim.height_left_m / SLOWEST_MS + AFTER_S)
    from_ns, until_ns = s.now_ns + round(from_s * 1e9), s.now_ns + round(until_s * 1e9)
    for one in s.moving:
        berth_m = PERSON_BERTH_M if one.radius_m < PERSON_M else BERTH_M
        away_m, _ = one.nearest(aim.enu_m[:2], from_ns, until_ns)
        if away_m < max(p.footprint_m, p.greatest_dimension_m) / 2 + one.radius_m + berth_m:
            return one
    return None
