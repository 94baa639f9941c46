"""Present and next action of the vehicle, in words for a display."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.outage import GpsLoss
from companion.flight.landing.route import Route
from companion.flight.landing.situation import COMMANDING, Phase, Situation
from companion.flight.landing.ways.endurance import LANDING_MS
from params import Parameters

NEAR_M = 1.0  # of a height: reached
WAITING = {Phase.SURVEY, Phase.APPROACH}  # phases that wait where they are until what is lost is back


@dataclass(frozen=True, slots=True)
class Outlook:
    """doing: what the vehicle does and what follows. abort: what an abort would do, "" for nothing.

    phase: in one word; a hold is a climb while it still climbs.
    """

    phase: Phase
    doing: str = ""
    abort: str = ""


def outlook(
    s: Situation, progress: LandingProgress, route: Route, gps_loss: GpsLoss, p: Parameters
) -> Outlook:
    """Return the present and next action of the vehicle, and the effect of an abort."""
    phase = progress.phase
    if phase not in COMMANDING:
        alone = f"{s.mode or 'the autopilot'} flies by itself, no commands"
        return Outlook(phase, alone if phase is Phase.FAILSAFE else "")
    aim = progress.aim
    left_m, commit = max(0.0, aim.height_left_m), f"abort till {p.commit_height_m:g} m"
    rise_m = 0.0 if s.position_enu_m is None else route.height_m - float(s.position_enu_m[2])
    climbs = math.isfinite(rise_m) and rise_m > NEAR_M and not gps_loss.lasts
    abort = f"climbs {rise_m:.0f} m, then holds" if climbs else "holds here"
    if gps_loss.lasts and phase in WAITING | {Phase.CLIMB, Phase.HOLD}:
        return Outlook(phase, "hovers: GPS lost, fly by hand", abort)
    if s.guided and phase in WAITING and (s.position_enu_m is None or not s.lidar_ok):
        return Outlook(phase, "hovers", abort)  # what is missing stands beside it
    match phase:
        case Phase.SURVEY if not s.guided:
            return Outlook(phase, "emergency: takes over next", "cancels the emergency")
        case Phase.SURVEY:
            return Outlook(phase, "surveying, then flies to a zone", abort)
        case Phase.APPROACH:
            away = f"{aim.away_m:.0f} m " if math.isfinite(aim.away_m) else ""
            return Outlook(phase, f"{away}to the point, then descends", abort)
        case Phase.DESCEND:
            sinks_s, low_m = max(0.0, left_m - p.final_height_m) / p.descent_speed_ms, p.final_height_m
            if (path := progress.path) is not None and math.isfinite(aim.away_m):
                sinks_s, low_m = aim.away_m / path.speed_ms(p), path.hover_m
            lands_s = sinks_s + min(left_m, low_m) / LANDING_MS
            times = f"LAND in {sinks_s:.0f} s, touchdown in {lands_s:.0f} s"
            return Outlook(phase, f"{times}; {commit}", abort)
        case Phase.FINAL if left_m < p.commit_height_m:
            return Outlook(phase, "landing: too low to abort")
        case Phase.FINAL:
            return Outlook(phase, f"landing: touchdown in {left_m / LANDING_MS:.0f} s; {commit}", abort)
        case _:
            again = "chooses again" if s.lidar_ok else "hovers"
            after = "holds for an order" if phase is Phase.HOLD else again
            if climbs:
                return Outlook(Phase.CLIMB, f"climbing {rise_m:.0f} m, then {after}", abort)
            return Outlook(phase, after, abort)
