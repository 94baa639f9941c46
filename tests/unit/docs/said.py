"""Texts to the pilot, extracted from the source: STATUSTEXT, alarms and refusals."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tests import REPOSITORY

SOURCES = (
    "companion/flight/app.py",
    "companion/flight/doctor/autopilot_fitness.py",
    "companion/flight/mapping/report_invariants.py",
    "companion/flight/decision_loop.py",
    "companion/flight/mode_requests.py",
    "companion/flight/outputs/announcers/report_announcer.py",
    "companion/flight/scan_feed.py",
    "companion/flight/outputs/announcers/lidar_announcer.py",
    "companion/flight/outputs/announcers/odometry_announcer.py",
    "companion/flight/outputs/announcers/wire_announcer.py",
    "companion/flight/sensors/diagnosis/explanation.py",
    "companion/flight/command_execution.py",
    "companion/flight/landing/situation.py",
    "companion/flight/situation_source.py",
    "companion/flight/landing/orders/operator_order.py",
    "companion/flight/recorder/recordings.py",
    "companion/flight/services/settings.py",
    "companion/flight/dashboard/alarms.py",
    "companion/flight/dashboard/order_handler.py",
    "companion/flight/dashboard/page.py",
    "companion/flight/dashboard/site.py",
    "companion/flight/dashboard/viewer.py",
    "companion/desk/replay/replay_page.py",
    "companion/flight/landing/assist/assist.py",
    "companion/flight/landing/assist/own_landing.py",
    "companion/flight/landing/looks/closer_look.py",
    "companion/flight/landing/looks/oblique_look.py",
    "companion/flight/landing/interruptions/crossing.py",
    "companion/flight/landing/interruptions/gps_loss.py",
    "companion/flight/landing/interruptions/late_abort.py",
    "companion/flight/landing/interruptions/reactions.py",
    "companion/flight/landing/wind/landing_wind.py",
    "companion/flight/landing/orders/order_acceptance.py",
    "companion/flight/landing/pilot_texts.py",
    "companion/flight/landing/point_objections.py",
    "companion/flight/landing/route.py",
    "companion/flight/landing/transitions.py",
    "companion/flight/landing/interruptions/withdrawal.py",
    "companion/flight/landing/interruptions/low_battery.py",
    "companion/flight/landing/interruptions/missing_input.py",
    "companion/flight/landing/interruptions/position_jump.py",
    "companion/flight/landing/phases/approach.py",
    "companion/flight/landing/phases/climb.py",
    "companion/flight/landing/phases/descent.py",
    "companion/flight/landing/phases/survey.py",
    "companion/flight/landing/phases/waiting.py",
    "companion/flight/landing/ways/fly_out.py",
    "companion/flight/landing/orders/mavlink_orders.py",
    "companion/flight/landing/orders/operator_order.py",
    "companion/flight/services/order_parameters.py",
    "companion/flight/landing/interruptions/preconditions.py",
    "companion/flight/outputs/announcers/landing_point_announcer.py",
    "companion/flight/link/link.py",
    "companion/flight/link/navigation_source.py",
    "companion/flight/link/wire/key_mismatch.py",
    "companion/flight/services/parameter_server.py",
)
# Where the text stands among a call's arguments.
SAYS = {
    "Reply": 1,
    "Change": 1,
    "Explanation": 0,
    "BrokenInvariantError": 0,
    "say": 1,
    "_say": 1,
    "call_pilot": 0,
    "_tell": 0,
    "_wait_for": 1,
    "break_off": 0,
    "statustext": 0,
}
GAP = "…"


def templates() -> dict[str, str]:
    """Return all texts, what is filled in replaced by `…`, without the prefix `SLZ: `, and their severities.

    A severity is empty where another file gives it.
    """
    found: dict[str, str] = {}
    for path in SOURCES:
        tree = ast.parse((REPOSITORY / path).read_text("utf-8"))
        for text, severity in (*_in_calls(tree), *_in_functions(tree)):
            text = text.removeprefix("SLZ: ")
            found[text] = severity or found.get(text, "")
    return {text: severity for text, severity in found.items() if text.strip(GAP + " :")}


def files_that_speak() -> set[str]:
    """Return the files that make texts for a pilot, by the names of what takes them."""
    words = ("Reply(", "Change(", "BrokenInvariantError(", "say(Severity", ".statustext(")
    files = (REPOSITORY / "companion").rglob("*.py")
    return {
        str(f.relative_to(REPOSITORY)) for f in files if any(word in f.read_text("utf-8") for word in words)
    }


def _in_calls(tree: ast.AST) -> Iterator[tuple[str, str]]:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        place = SAYS.get(name)
        if place is not None and len(node.args) > place:
            severity = getattr(node.args[0], "attr", "") if name in ("say", "_say") else ""
            yield from ((text, severity) for text in _texts(node.args[place]))
        elif name == "append" and isinstance(node.args[0], ast.Tuple) and len(node.args[0].elts) == 3:
            level = getattr(node.args[0].elts[0], "value", "")
            yield from ((text, level) for text in _texts(node.args[0].elts[2]))  # an alarm: level, key, text


def _in_functions(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield what functions return, or put together, to be said by others."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and node.name in ("MissingInput", "KeyMismatch"):
            members = (ast.literal_eval(part.value) for part in node.body if isinstance(part, ast.Assign))
            yield from ((m if isinstance(m, str) else " ".join(m), "") for m in members)
        if isinstance(node, ast.FunctionDef) and node.name in ("update", "objection", "why_not_led"):
            for part in ast.walk(node):
                if isinstance(part, ast.Return) and part.value is not None:
                    yield from _returned(part.value)
        if isinstance(node, ast.Assign) and _is_of_words(node.targets[0]):
            yield from ((text, "") for text in _texts(node.value))


def _is_of_words(target: ast.expr) -> bool:
    """Tell whether what is assigned here is said: to a text, a reason, or a precondition that is broken."""
    if isinstance(target, ast.Subscript):
        return getattr(target.value, "id", "") == "broken"
    return getattr(target, "id", "") in ("text", "reason")


def _returned(value: ast.expr) -> Iterator[tuple[str, str]]:
    severity = ""
    if isinstance(value, ast.Tuple):
        severity, value = getattr(value.elts[0], "attr", ""), value.elts[1]
    yield from ((text, severity) for text in _texts(value))


def _texts(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Constant(value=str(text)):
            yield text
        case ast.JoinedStr():
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else GAP for part in node.values)
        case ast.IfExp():
            yield from (*_texts(node.body), *_texts(node.orelse))
        case ast.BoolOp():
            for value in node.values:
                yield from _texts(value)
        case ast.BinOp():
            left, right = list(_texts(node.left)) or [GAP], list(_texts(node.right)) or [GAP]
            yield left[0] + right[0]
        case ast.Subscript():
            yield from _texts(node.value)
        case _:
            pass
