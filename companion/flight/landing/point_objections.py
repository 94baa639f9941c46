"""Objections to a landing at the target point, by the newest report: judgements without memory."""

from __future__ import annotations

from companion.flight.landing.fenced_zones import aim_is_beyond_fence
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.confirmation import unconfirmed
from companion.flight.landing.situation import Situation
from companion.flight.landing.ways.way_choice import corridors_of, is_blocked, straight_down_is_blocked
from params import Parameters
from slz import PointState
from slz.landing_point.corridors import corridor_radius_m
from slz.wires.detected_wire import nearest_wire


def objection(s: Situation, progress: LandingProgress, parameters: Parameters) -> str | None:
    """Return the first reason against the descent in the order of checks below, None without one."""
    if not s.lidar_ok:
        return s.no_map_reason.text
    judged = progress.aim.judgement(s.selected)
    if judged is not PointState.SAFE:
        return f"point {judged.value}" + cause_suffix(s, progress, parameters)
    if aim_is_beyond_fence(s, progress, parameters):
        return "point beyond the fence"
    surface = unconfirmed(s, progress, parameters)
    if surface is not None:
        return f"{surface}: not confirmed"
    if _is_way_blocked(s, progress):
        return "way in blocked" + wire_suffix(s, progress, parameters)
    return None


def may_be_water(s: Situation, progress: LandingProgress, parameters: Parameters) -> bool:
    """Return whether the newest report suspects water at the point."""
    selected = s.selected
    suspected = selected is not None and selected.surface.water > parameters.water_suspicion
    return suspected and progress.aim.is_at(selected)


def cause_suffix(s: Situation, progress: LandingProgress, parameters: Parameters) -> str:
    """Return the end of a reason against the point: an object that came, suspected water, or a wire."""
    came = s.intrusion
    if came is not None:
        return f": object of {came.height_m:.1f} m came"
    return water_suffix(s, progress, parameters) or wire_suffix(s, progress, parameters)


def water_suffix(s: Situation, progress: LandingProgress, parameters: Parameters) -> str:
    """Return the end of a reason against the point, where water is suspected there."""
    return ": may be water" if may_be_water(s, progress, parameters) else ""


def wire_suffix(s: Situation, progress: LandingProgress, parameters: Parameters) -> str:
    """Return the end of a reason against the point or the way down, where a wire passes over both."""
    if s.report is None or progress.aim.enu_m is None:
        return ""
    nearest = nearest_wire(s.report.wires, progress.aim.enu_m)
    return "" if nearest is None or nearest[1] > corridor_radius_m(parameters) else ": wire"


def _is_way_blocked(s: Situation, progress: LandingProgress) -> bool:
    """Return whether the way down is obstructed; an urgent landing goes straight down anyway."""
    corridors = corridors_of(s, progress.aim)
    if progress.path is not None:
        return is_blocked(corridors, progress.path)
    return straight_down_is_blocked(corridors) and not progress.is_urgent
