"""Stateless alarm rules: an alarm is active while its reason exists."""

from __future__ import annotations

import math
from typing import Any, Literal

from companion.flight.dashboard.freshness import VERDICT

Level = Literal["critical", "warning"]
OTHER_M = 0.5  # from the judged point: another one


def active_alarms(state: dict[str, Any], selected: dict[str, Any] | None) -> list[dict[str, str]]:
    """Return the active alarms, most severe first.

    Parameters
    ----------
    state
        Document of `companion.flight.dashboard.state_document.state`.
    selected
        Landing point in the newest report, None without one.
    """
    found: list[tuple[Level, str, str]] = []
    aim = state["aim_enu_m"]
    elsewhere = (
        selected is not None and aim is not None and math.dist(aim[:2], selected["enu_m"][:2]) > OTHER_M
    )
    if VERDICT in state["past"] or elsewhere:
        selected = None  # judged in the past, or before it chose another
    water = ": may be water" if selected is not None and selected["may_be_water"] else ""
    if selected is not None and selected["state"] == "unsafe":
        by = " (far map)" if selected["judged_by"] == "far" else ""
        blocked = "" if selected["headings_deg"] else f": {selected['blocked_by']}"
        found.append(("critical", "point-unsafe", f"LANDING POINT UNSAFE{by}{water or blocked}"))
    if not state["connected"]:
        separated = f": {state['key_mismatch']}" if state["key_mismatch"] else ""
        found.append(("critical", "no-autopilot", f"NO AUTOPILOT{separated}"))
    elif not state["heard"]:
        found.append(("critical", "mode-unknown", "FLIGHT MODE UNKNOWN: no heartbeat"))
    if state["phase"] == "failsafe":
        found.append(
            ("critical", "failsafe", f"AUTOPILOT FAILSAFE: {state['mode'] or 'IT'} FLIES, TAKE OVER")
        )
    elif state["failsafe"]:
        found.append(("critical", "failsafe", "AUTOPILOT FAILSAFE"))
    if state["estimate_lost"]:
        found.append(("critical", "estimate", f"AUTOPILOT LOST ITS {state['estimate_lost'].upper()}"))
    if state["gps"] and state["armed"]:
        lost = state["gps"] == "lost"
        found.append(("critical", "gps", "GPS LOST" if lost else "GPS GLITCH: position may jump"))
    if state["connected"] and state["armed"] and not state["lidar_ok"] and not state["on_ground"]:
        found.append(("critical", "no-lidar", state["blind"].upper()))
    if state["east_m"] is None and state["connected"]:
        found.append(("critical", "no-position", "NO POSITION"))
    if state["battery_low"]:
        found.append(("critical", "battery", "BATTERY LOW"))
    if state["pipeline_failed"]:
        found.append(("critical", "pipeline", "MAP FAILED: no zone can be trusted"))
    if selected is not None and selected["state"] == "unknown":
        text = f"Landing point not judged{water or ': nothing seen there'}"
        found.append(("warning", "point-unknown", text))
    if state["no_commands"]:
        found.append(("warning", "no-commands", f"Mapping only, no commands: {state['no_commands']}"))
    if state["unfit"]:
        more = f" and {len(state['unfit']) - 1} more: see slz doctor" if len(state["unfit"]) > 1 else ""
        found.append(("warning", "unfit", f"Autopilot not set up: {state['unfit'][0]}{more}"))
    found.extend(("warning", f"lidar-{one['cause']}", one["line"]) for one in state["lidar_faults"])
    if state["blocked"]:
        found.append(("warning", "blocked", "Obstacle ahead: held back"))
    return [{"level": level, "key": key, "text": text} for level, key, text in found]
