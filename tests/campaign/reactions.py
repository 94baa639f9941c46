"""Required reactions of the companion to each fault in each state (docs/faults.md), and their checks.

A check takes the outside observations of a flight and returns the deviations, or nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from companion.flight.landing.situation import Phase
from tests.campaign.log import Flown
from tests.campaign.witness import FAILSAFE, NOBODY, PILOT, Sight

COMMITTED_M = 3.0  # from here the rest of the way is shorter than any reaction
STOPPED_MS = 1.0
LETS_GO_S, STANDS_BACK_S = 1.5, 2.0
ON_GROUND_M = 0.3
BY_PILOT = ("pilot_mode", "pilot_stick", "fly_here", "second_companion", "wing_flight")
Reaction = Callable[[Flown], str]


@dataclass(frozen=True, slots=True)
class Row:
    """Reactions to one fault: before the descent, in the descent, in the autopilot's landing, climbing."""

    before: tuple[Reaction, ...]
    descent: tuple[Reaction, ...]
    final: tuple[Reaction, ...]
    climb: tuple[Reaction, ...]

    def of(self, state: Phase) -> tuple[Reaction, ...]:
        """Return the reactions in a state."""
        match state:
            case Phase.DESCEND:
                return self.descent
            case Phase.FINAL:
                return self.final
            case Phase.CLIMB:
                return self.climb
        return self.before


def seen(flight: Flown, after_s: float = 0.0) -> list[Sight]:
    """Return what was seen while the fault lasted, from so long after it began."""
    began, ended = flight["began_s"], flight["ended_s"]
    sights = (Sight(*row) for row in flight["path"])
    return [s for s in sights if began + after_s <= s.t_s <= ended]


# ---- reactions ------------------------------------------------------------------------------------


def lands(flight: Flown) -> str:
    """It lands in the end, if need be elsewhere or at the second try."""
    return "" if flight["landed"] else f"did not land: {flight['phase']} in {flight['mode']}"


def lands_or_calls(flight: Flown) -> str:
    """It lands in the end, or hovers and calls the pilot."""
    called = flight["phase"] == "hold" and any("take over" in text for text in flight["heard"])
    return "" if called else lands(flight)


def goes_on(flight: Flown) -> str:
    """It lands as if nothing were wrong: what is aborted or lost is not for this reason."""
    causes = [text for text in flight["heard"] if "lost" in text or "invalid" in text or "jumped" in text]
    return f"said {causes[0]!r}" if causes else lands(flight)


def hands_off(flight: Flown) -> str:
    """Within 2 s it commands no more; the pilot keeps the vehicle, in the air and in the pilot's mode."""
    if flight["landed"] and _reached_ground_at_once(flight):
        return ""
    late = [s for s in seen(flight, 2.0) if s.phase not in (Phase.IDLE.value, Phase.LANDED.value)]
    if late:
        return f"still in {late[0].phase} at {late[0].t_s:.1f} s"
    return "landed all the same" if flight["landed"] else ""


def lets_go(flight: Flown) -> str:
    """Within 1.5 s of the stick that moves its landing it has given the vehicle to the pilot, in words too.

    A stick that moves nothing, as in GUIDED, changes nothing: it goes on.
    """
    if flight["taken_by"] != PILOT:
        return goes_on(flight)
    if _down_within(flight, LETS_GO_S):
        return ""
    late = [
        s for s in _since_taken(flight, LETS_GO_S) if s.phase not in (Phase.IDLE.value, Phase.LANDED.value)
    ]
    if late:
        return f"still in {late[0].phase} {late[0].t_s - flight['taken_s']:.1f} s after the stick moved it"
    said = any("hands off" in text for text in flight["heard"])
    return "" if said and flight["hands_off"] else "did not say that it gave the vehicle to the pilot"


def yields(flight: Flown) -> str:
    """It commands no more, in words too, once it has seen that it is not the only one; otherwise it goes on.

    Of a place that its next setpoint overwrites within 50 ms it sees every second one.
    """
    if not flight["hands_off"]:
        return lands_or_calls(flight)
    return "" if any("hands off" in text for text in flight["heard"]) else "did not say so"


def stands_back(*lost: str) -> Reaction:
    """Return the reaction to a failsafe of the autopilot: phase failsafe, and a call that says what is lost.

    What the autopilot then does with the vehicle is its own; a loss that it answers by nothing is survived.
    """

    def check(flight: Flown) -> str:
        if flight["taken_by"] != FAILSAFE:
            return lands_or_calls(flight)
        if _down_within(flight, STANDS_BACK_S):
            return ""
        over_s = math.inf if flight["over_s"] is None else flight["over_s"]
        late = [
            s
            for s in _since_taken(flight, STANDS_BACK_S)
            if s.phase != Phase.FAILSAFE.value
            and not (s.phase == Phase.IDLE.value and s.t_s >= over_s)
            and s.height_m > ON_GROUND_M
        ]
        if late:
            return f"in {late[0].phase} {late[0].t_s - flight['taken_s']:.1f} s after the failsafe took it"
        calls = [text.lower() for text in flight["calls"] if "take over" in text]
        said = any(word in text for text in calls for word in lost)
        return "" if said else f"did not call the pilot for {' or '.join(lost)}"

    check.__doc__ = "Within 2 s it stands back and calls the pilot."
    return check


def stops(after_s: float) -> Reaction:
    """Return the reaction to stand still from some seconds after the beginning until the end of the fault."""

    def check(flight: Flown) -> str:
        moving = [s for s in seen(flight, after_s) if s.level_ms > STOPPED_MS or abs(s.climb_ms) > STOPPED_MS]
        return f"still moves at {moving[0].t_s:.1f} s" if moving else ""

    check.__doc__ = f"Within {after_s:g} s it stands still, as long as the fault lasts."
    return check


def breaks_off(within_s: float) -> Reaction:
    """Return the reaction to climb within some seconds, unless it was about to touch down."""

    def check(flight: Flown) -> str:
        during = seen(flight)
        if not during or during[-1].t_s - during[0].t_s < within_s:
            return ""
        left = [s for s in during if s.t_s <= during[0].t_s + within_s]
        if left[-1].height_m < COMMITTED_M:
            return ""
        landing = (Phase.DESCEND.value, Phase.FINAL.value)
        return f"still in {left[-1].phase} after {within_s:g} s" if left[-1].phase in landing else ""

    check.__doc__ = f"Within {within_s:g} s it leaves the point, unless it is about to touch down."
    return check


def _reached_ground_at_once(flight: Flown) -> bool:
    touchdown = flight["touchdown"]
    return touchdown is not None and touchdown["t_ns"] * 1e-9 < flight["began_s"] + 2.5


def _since_taken(flight: Flown, after_s: float) -> list[Sight]:
    """Return what was seen from so long after somebody else took the vehicle, to the end."""
    sights = (Sight(*row) for row in flight["path"])
    return [s for s in sights if s.t_s >= flight["taken_s"] + after_s]


def _down_within(flight: Flown, seconds: float) -> bool:
    touchdown = flight["touchdown"]
    return touchdown is not None and touchdown["t_ns"] * 1e-9 < flight["taken_s"] + seconds + 0.5


# ---- the table ------------------------------------------------------------------------------------


def _always(*reactions: Reaction) -> Row:
    return Row(reactions, reactions, reactions, reactions)


_BLIND = Row(
    before=(stops(4.0), lands_or_calls),
    descent=(breaks_off(3.5), lands_or_calls),
    final=(breaks_off(3.5), lands_or_calls),
    climb=(lands_or_calls,),
)
_SILENT = Row(  # the autopilot hears nothing: it stops by itself, or goes on landing
    before=(stops(5.5), lands_or_calls),
    descent=(stops(5.5), lands_or_calls),
    final=(lands_or_calls,),
    climb=(stops(5.5), lands_or_calls),
)
TABLE: dict[str, Row] = {
    "none": _always(goes_on),
    "link_loss": _SILENT,
    "link_bursts": _always(lands_or_calls),
    "link_delay": _always(lands_or_calls),
    "link_duplicates": _always(goes_on),
    "link_reordering": _always(lands_or_calls),
    "link_corruption": _always(lands_or_calls),
    "reboot": _always(lands),
    "ekf_jump": _always(lands),
    "baro_jump": _always(goes_on),
    "gps_drift": _always(lands),
    "estimate_sway": _always(lands),
    "autopilot_held_up": _always(lands_or_calls),
    "pilot_mode": _always(hands_off),
    "pilot_stick": _always(lets_go),
    "gps_loss": _always(stands_back("ekf", "position", "gps", "velocity")),
    "gps_denied": _always(stands_back("ekf", "position", "gps", "velocity")),
    "gps_first_lost": _always(goes_on),
    "gps_multipath": _always(lands_or_calls),
    "gps_slow_drift": _always(lands_or_calls),
    "gps_spoof": _always(lands_or_calls),
    "gps_takeover": _always(lands_or_calls),
    "yaw_drift": _always(lands_or_calls),
    "battery_failsafe": _always(stands_back("battery")),
    "radio_failsafe": _always(stands_back("radio", "rc lost")),
    "fence_breach": _always(stands_back("fence")),
    "second_vehicle": _always(goes_on),
    "second_station": _always(goes_on),
    "gimbal": _always(goes_on),
    "fly_here": _always(yields),
    "second_companion": _always(yields),
    "wing_flight": _always(hands_off),
    "lidar_stop": _BLIND,
    "lidar_half": _always(goes_on),
    "lidar_stuck": _always(lands_or_calls),
    "lidar_garbage": _always(lands_or_calls),
    "lidar_clock": _always(lands),
    "lidar_misaligned": _always(lands_or_calls),
    "lidar_dust": _always(lands_or_calls),
    "lidar_rain": _always(lands_or_calls),
    "lidar_plumes": _always(lands_or_calls),
    "lidar_snow": _always(lands_or_calls),
    "lidar_loss": _always(goes_on),
    "lidar_pauses": _always(lands_or_calls),
    "lidar_cover": _always(lands_or_calls),
    "lidar_dirt": _always(lands_or_calls),
    "lidar_row": _always(goes_on),
    "lidar_half_rate": _always(goes_on),
    "lidar_step": _always(lands_or_calls),
    "lidar_drift": _always(lands_or_calls),
    "lidar_elsewhere": _BLIND,
    "wind_missing": _always(goes_on),
    "wind_absurd": _always(goes_on),
    "slow_computer": _always(lands_or_calls),
    "full_disk": _always(goes_on),
    "wall_clock": _always(goes_on),
    "killed": Row(
        before=(stops(5.5), lands), descent=(stops(5.5), lands), final=(lands,), climb=(stops(5.5), lands)
    ),
}


def faults_of(flight: Flown) -> list[str]:
    """Return everything that is wrong with a flight: the safety of all flights first, then its reaction."""
    wrong = unsafe(flight)
    if flight["error"]:
        wrong.append(flight["error"])
    if flight["commands_while_pilot_flies"]:
        wrong.append(f"{flight['commands_while_pilot_flies']} commands {_against(flight)}")
    if flight["hands_off"] and flight["fault"] not in BY_PILOT:
        wrong.append("gave the vehicle to a pilot who had not touched it")
    if flight["began_s"] is None:
        return [*wrong, "the state was never reached"]
    reactions = TABLE[flight["fault"]].of(_state(flight))
    return wrong + [text for reaction in reactions if (text := reaction(flight))]


def unsafe(flight: Flown) -> list[str]:
    """Return whether it touched unsafe ground, or flew into something, by the companion's doing.

    Not by a failsafe of the autopilot or by the pilot's stick: the report counts these apart.
    """
    return [] if flight["landed_by"] != NOBODY else bad_end(flight)


def bad_end(flight: Flown) -> list[str]:
    """Return whether it touched unsafe ground, does not stand on its gear, or flew into something.

    Whoever had it.
    """
    wrong = [flight.get("touchdown_fault") or "touched unsafe ground"] if flight["safe"] is False else []
    return [*wrong, "collided"] if flight["collision"] is not None else wrong


def _against(flight: Flown) -> str:
    return "in the autopilot's failsafe" if flight["taken_by"] == FAILSAFE else "in a mode of the pilot's"


def _state(flight: Flown) -> Phase:
    """Return the state that the fault met: LAND may have been told in the very tick before it began."""
    state, during = Phase(flight["state"]), seen(flight)
    landing = state is Phase.DESCEND and during and during[0].phase == Phase.FINAL.value
    return Phase.FINAL if landing else state
