"""Preconditions of each stage of a landing about the vehicle: the table, and each reaction flown."""

import re

import numpy as np
import pytest

from companion.flight.landing.interruptions.preconditions import TABLE, Precondition, Reaction, Stage
from companion.flight.landing.situation import MissingInput, Phase, Severity, VehicleCommands
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.statustext import CHUNK_BYTES
from slz import PointState
from tests import REPOSITORY
from tests.unit.companion.flight.landing.flight import Flight, zone
from tests.unit.docs.said import templates

DOCS = REPOSITORY / "docs" / "reactions.md"
GUIDED_PHASES = [Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.CLIMB, Phase.HOLD]


def flown_to(phase: Phase, **settings: object) -> Flight:
    """A flight in a phase; climbing and holding after an abort in the descent."""
    flight = Flight([zone(1, 20, 0)], **settings)
    if phase in (Phase.CLIMB, Phase.HOLD):
        flight.fly_to(Phase.DESCEND).run(3)
        if phase is Phase.HOLD:
            flight.executive.orders.abort(flight.situation())
        else:
            flight.state = lambda _height, _point: PointState.UNSAFE
        flight.fly_to(phase)
    else:
        flight.fly_to(phase)
    return flight


def is_commanding(commands: VehicleCommands) -> bool:
    return (
        commands.velocity_enu_ms is not None or commands.mode is not None or commands.target_enu_m is not None
    )


def silent_since(flight: Flight, first: int) -> bool:
    return not any(is_commanding(commands) for *_, commands in flight.commands[first:])


# ---- the table -------------------------------------------------------------------------------------


def test_the_documented_table_is_the_one_that_flies() -> None:
    lines = DOCS.read_text("utf-8").splitlines()
    header = next(n for n, line in enumerate(lines) if line.startswith("| Precondition |"))
    assert [cell.strip() for cell in lines[header].split("|")[2:-1]] == [stage.value for stage in Stage]
    documented = {}
    for line in lines[header + 2 :]:
        if not line.startswith("|"):
            break
        name, *reactions = (cell.strip() for cell in line.split("|")[1:-1])
        documented[name] = reactions
    assert list(documented.items()) == [
        (precondition.value, [TABLE[precondition][stage].value for stage in Stage])
        for precondition in Precondition
    ]


def test_every_reaction_is_explained() -> None:
    text = DOCS.read_text("utf-8")
    assert [reaction.value for reaction in Reaction if f"| {reaction.value} | " not in text] == []
    assert set(TABLE) == set(Precondition)


def test_every_text_quoted_on_the_page_is_one_of_the_program() -> None:
    texts = [re.escape(text).replace("…", ".+") for text in templates()]
    longer = [text for text in texts if len(text.replace(".+", "")) > 10]
    quoted = set(re.findall(r'"([^"]+)"', DOCS.read_text("utf-8"))) - {
        "on the ground",
        "PrecLand: Target Lost",
    }
    assert len(quoted) > 15
    whole = {quote for quote in quoted if any(re.search(text, quote) for text in longer)}
    assert {quote for quote in quoted - whole if not any(re.escape(quote) in text for text in texts)} == set()


# ---- over the point --------------------------------------------------------------------------------


def test_a_landing_pushed_off_the_point_is_broken_off() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 9)
    flight.push = np.array([0.8, 0.0, 0.0])
    flight.fly_to(Phase.CLIMB)
    assert np.hypot(*(flight.position - [20, 0, 0])[:2]) < 1.7
    assert flight.executive.tally.abort_reasons[0].endswith("m off the point")
    assert flight.mode == "GUIDED"


def test_a_gust_that_is_over_in_a_moment_breaks_nothing_off() -> None:
    flight = flown_to(Phase.FINAL)
    flight.position += [1.2, 0, 0]
    flight.run(0.3)
    flight.position -= [1.2, 0, 0]
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_an_estimate_that_wanders_where_the_vehicle_stands_calls_nobody() -> None:
    """Until the autopilot has detected the landing (PX4 in SIH: 7 s, in which it wandered by 0.5 m)."""
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 0.1)
    flight.position[2] = 0.06  # not yet landed
    flight.estimate_is_off_m = np.array([0.7, 0.0, 0.0])
    flight.sinks = False
    flight.run(5)
    assert not [text for text in flight.texts if "take over" in text]


def test_lower_than_the_point_it_does_not_stand_on_it() -> None:
    """It slides off a roof, or its estimate is too low."""
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 0.1)
    flight.position[2] = 0.06
    flight.estimate_is_off_m = np.array([0.7, 0.0, -0.5])
    flight.sinks = False
    flight.run(5)
    assert [text for text in flight.texts if "off the point: take over" in text]


def test_below_commit_height_the_pilot_is_told_how_far_off_it_lands() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.3)
    flight.push = np.array([1.0, 0.0, 0.0])
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    calls = [text for text in flight.texts if "off the point: take over" in text]
    assert len(calls) == 1
    assert flight.texts[-1].startswith("SLZ: landed 1.")
    assert flight.severities[-1] is Severity.WARNING


def test_a_landing_on_the_point_says_how_near_it_is() -> None:
    flight = flown_to(Phase.FINAL).fly_to(Phase.LANDED)
    assert flight.texts[-1].startswith("SLZ: landed, 0.")
    landed_enu_m = flight.executive.tally.landed_enu_m
    assert landed_enu_m == pytest.approx(flight.position, abs=0.2)
    flight.executive.change_frame(lambda enu_m: enu_m + 100.0)
    assert flight.executive.tally.landed_enu_m == pytest.approx(landed_enu_m + 100.0)
    assert flight.executive.tally.off_point_m == pytest.approx(0, abs=0.2)


def test_the_limit_is_a_parameter() -> None:
    flight = flown_to(Phase.FINAL, off_point_m=5.0)
    flight.position += [3.0, 0, 0]
    flight.run(3)
    assert flight.executive.phase is Phase.FINAL


# ---- sticks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("below_m", [9.0, 1.2])
def test_a_stick_moved_in_the_landing_gives_the_vehicle_to_the_pilot(below_m: float) -> None:
    flight = flown_to(Phase.FINAL)
    flight.sticks_us = (1504, 1497)
    flight.until(lambda f: f.position[2] < below_m)
    flight.sticks_us = (1800, 1497)
    flight.run(0.5)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts[-1] == "SLZ: pilot moves the sticks in LAND: hands off"
    assert flight.executive.tally.hands_off == 1
    first = len(flight.commands)
    flight.run(5)
    assert silent_since(flight, first)


def test_a_transmitter_that_rests_off_its_middle_or_twitches_is_no_pilot() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.sticks_us = (1620, 1380)
    flight.fly_to(Phase.FINAL)
    flight.sticks_us = (1650, 1350)
    flight.run(1)
    flight.sticks_us = (1740, 1350)
    flight.step()
    flight.sticks_us = (1620, 1380)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0


def test_a_stick_held_since_before_the_landing_is_the_pilot_s() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.sticks_us = (1800, 1500)
    flight.fly_to(Phase.FINAL).run(0.6)
    assert flight.executive.phase is Phase.IDLE
    assert flight.executive.tally.hands_off == 1


@pytest.mark.parametrize("broken", ["sticks", "estimate"])
def test_a_landing_that_wavers_about_the_commit_height_is_watched_all_the_same(broken: str) -> None:
    flight = flown_to(Phase.FINAL)
    flight.sticks_us = (1500, 1500)
    flight.sinks = False
    flight.run(0.2)
    commit_m = flight.parameters.commit_height_m
    if broken == "sticks":
        flight.sticks_us = (1800, 1500)
    else:
        flight.estimate_lost = "position"
    for turn in range(30):
        flight.position[2] = commit_m + (0.03 if turn % 2 else -0.03)
        flight.run(0.1)
    assert any(said in text for text in flight.texts for said in ("hands off", "take over"))


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.DESCEND])
def test_in_guided_phases_sticks_do_nothing(phase: Phase) -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.sticks_us = (1500, 1500)
    flight.fly_to(phase)
    flight.sticks_us = (1900, 1500)
    flight.run(1)
    assert flight.executive.tally.hands_off == 0
    assert flight.executive.phase in (phase, Phase.APPROACH, Phase.DESCEND, Phase.FINAL)


# ---- failsafes and the estimate --------------------------------------------------------------------


@pytest.mark.parametrize("phase", [*GUIDED_PHASES, Phase.FINAL])
def test_a_mode_taken_by_the_autopilot_s_failsafe_is_not_the_pilot_s(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.mode, flight.failsafe, flight.cause = "RTL", True, "Battery 1 low voltage"
    first = len(flight.commands)
    flight.run(8)
    assert flight.executive.phase is Phase.FAILSAFE
    assert silent_since(flight, first)
    told = [text for text in flight.texts if "RTL" in text]
    assert told == ["SLZ: failsafe (Battery 1 low): RTL, take over"]
    assert Severity.CRITICAL in flight.severities
    assert flight.executive.tally.hands_off == 0
    assert flight.executive.tally.failsafes == ["Battery 1 low voltage"]


@pytest.mark.parametrize("mode", [max(ARDUPILOT.modes, key=len), max(PX4.modes, key=len), "AUTO.RTL"])
@pytest.mark.parametrize("cause", ["GPS lost", "x" * CHUNK_BYTES])
def test_every_text_about_a_failsafe_fits_one_statustext(mode: str, cause: str) -> None:
    flight = flown_to(Phase.APPROACH)
    flight.failsafe, flight.cause = True, cause
    flight.run(1.5)
    flight.mode = mode
    flight.run(8)
    told = [text for text in flight.texts if "failsafe" in text]
    assert told[0].startswith("SLZ: failsafe (")
    assert told[0].endswith("): going on")
    assert told[1].startswith("SLZ: failsafe (")
    assert told[1].endswith(f"): {mode}, take over")
    assert max(map(len, told)) <= CHUNK_BYTES


def test_a_fence_breach_takes_the_mode_without_a_failsafe_state() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.mode, flight.breached, flight.cause = "RTL", True, "fence breached"
    flight.run(1)
    assert flight.executive.phase is Phase.FAILSAFE
    assert "SLZ: failsafe (fence breached): RTL, take over" in flight.texts


@pytest.mark.parametrize("phase", [*GUIDED_PHASES, Phase.FINAL])
def test_a_lost_estimate_ends_all_commands_and_tells_the_pilot(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.estimate_lost = "position"
    flight.run(1.3)
    assert flight.executive.phase is Phase.FAILSAFE
    told = next(text for text in flight.texts if text.startswith("SLZ: failsafe"))
    assert told.startswith("SLZ: failsafe (position lost): ")
    assert told.endswith(", take over")
    first = len(flight.commands)
    flight.run(10)
    assert silent_since(flight, first)


def test_an_estimate_lost_for_a_moment_changes_nothing() -> None:
    flight = flown_to(Phase.FINAL)
    flight.estimate_lost = "velocity"
    flight.run(0.6)
    flight.estimate_lost = ""
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.failsafes == []


def test_a_failsafe_that_leaves_the_mode_to_us_is_told_once_and_the_landing_goes_on() -> None:
    flight = flown_to(Phase.DESCEND)
    flight.failsafe, flight.cause = True, "Battery 1 low voltage"
    flight.fly_to(Phase.LANDED)
    told = [text for text in flight.texts if "failsafe" in text]
    assert told == ["SLZ: failsafe (Battery 1 low voltage): going on"]


def test_a_failsafe_that_is_told_after_its_mode_is_not_left_to_the_pilot() -> None:
    """PX4 tells of its mode at once, and of the failsafe with the next heartbeat."""
    flight = flown_to(Phase.DESCEND)
    flight.mode = "AUTO.LAND"
    flight.run(0.8)
    assert flight.texts[-1] == "SLZ: AUTO.LAND set, not by SLZ: hands off"
    flight.failsafe, flight.cause = True, "Failsafe activated"
    flight.run(0.2)
    assert flight.executive.phase is Phase.FAILSAFE
    assert flight.texts[-1] == "SLZ: failsafe (Failsafe): AUTO.LAND, take over"
    assert (flight.executive.tally.hands_off, flight.executive.tally.failsafes) == (0, ["Failsafe activated"])


def test_a_failsafe_long_after_the_pilot_took_over_is_none_of_ours() -> None:
    flight = flown_to(Phase.DESCEND)
    flight.mode = "LOITER"
    flight.run(3)
    flight.failsafe = True
    flight.run(1)
    assert flight.executive.phase is Phase.IDLE
    assert flight.executive.tally.hands_off == 1


def test_a_gps_that_leaves_the_map_is_told_once() -> None:
    flight = flown_to(Phase.DESCEND, odometry="map")
    flight.tracked, flight.gps_drift_m = True, 0.7
    flight.run(1)
    assert not any("drifts" in text for text in flight.texts)
    flight.gps_drift_m = 1.04
    flight.run(5)
    told = [text for text in flight.texts if "drifts" in text]
    assert told == ["SLZ: GPS drifts off the LiDAR, 1.0 m in 10 s"]


def test_each_further_mode_of_a_failsafe_is_told() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.mode, flight.failsafe = "RTL", True
    flight.run(2)
    flight.mode = "LAND"
    flight.run(2)
    assert flight.texts[-1] == "SLZ: failsafe: LAND, take over"


def test_after_a_failsafe_nothing_begins_without_a_new_hand_over() -> None:
    """PX4 returns to its guided mode by itself when setpoints arrive again."""
    flight = flown_to(Phase.APPROACH)
    flight.mode, flight.failsafe = "POSCTL", True
    flight.run(5)
    flight.mode, flight.failsafe = "GUIDED", False
    flight.run(20)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts[-1] == "SLZ: failsafe over: leave GUIDED, set it again"
    flight.mode = "LOITER"
    flight.run(2)
    flight.mode = "GUIDED"
    flight.fly_to(Phase.SURVEY)


@pytest.mark.parametrize(
    ("auto", "mode", "told"),
    [
        (True, "OFFBOARD", "failsafe over: leave OFFBOARD, set it again"),
        (False, "OFFBOARD", "failsafe over, OFFBOARD: order again"),
        (True, "AUTO.PRECLAND", "failsafe over, AUTO.PRECLAND: hand over again"),
        (False, "AUTO.LOITER", "failsafe over, AUTO.LOITER: hand over again"),
    ],
)
def test_after_a_failsafe_the_pilot_is_told_what_hands_over_in_this_mode(
    auto: bool, mode: str, told: str
) -> None:
    flight = Flight([zone(1, 20, 0)], auto=auto).run(2)
    flight.executive.orders.land_at_best(flight.situation())
    flight.run(2)
    flight.mode, flight.failsafe = "AUTO.LOITER", True
    flight.run(5)
    flight.mode, flight.failsafe = mode, False
    flight.run(5)
    assert flight.texts[-1] == f"SLZ: {told}"
    assert len(flight.texts[-1]) <= 50


def test_an_order_of_the_operator_hands_over_again() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.mode, flight.failsafe = "RTL", True
    flight.run(2)
    flight.mode, flight.failsafe = "GUIDED", False
    flight.run(2)
    assert flight.executive.orders.land_at_best(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)


@pytest.mark.parametrize("mode", ["GUIDED", "LOITER"])
def test_without_an_estimate_no_order_to_land_is_taken(mode: str) -> None:
    flight = Flight([zone(1, 20, 0)], auto=False).run(2)
    flight.estimate_lost, flight.mode = "position", mode
    order = flight.executive.orders.land_at_best if mode == "GUIDED" else flight.executive.orders.land_now
    reply = order(flight.situation())
    assert (reply.accepted, reply.reason) == (False, "position lost: fly by hand")


def test_down_by_a_failsafe_is_not_landed() -> None:
    flight = flown_to(Phase.FINAL)
    flight.estimate_lost = "position"
    flight.until(lambda f: f.position[2] < 0.05).run(2)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts[-1] == "SLZ: on the ground by the autopilot's failsafe"


def test_a_guided_mode_that_comes_back_by_itself_is_told_each_half_minute() -> None:
    flight = Flight([zone(1, 10, 0)])
    flight.mode, flight.failsafe = "LOITER", True
    flight.run(3)
    flight.mode, flight.failsafe = "GUIDED", False
    flight.run(70)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts.count("SLZ: no hand-over: leave GUIDED, set it again") == 3
    flight.mode = "LOITER"
    flight.run(1)
    flight.mode = "GUIDED"
    flight.fly_to(Phase.SURVEY)


def test_a_start_in_the_middle_of_a_failsafe_begins_nothing() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.mode, flight.failsafe = "POSCTL", True
    flight.run(3)
    flight.mode, flight.failsafe = "GUIDED", False
    flight.run(30)
    assert flight.phases == [Phase.IDLE]


# ---- who set the mode ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("switched", "text"),
    [(True, "SLZ: pilot set LOITER: hands off"), (False, "SLZ: LOITER set, not by SLZ: hands off")],
)
def test_the_pilot_is_named_only_where_his_switch_was_seen(switched: bool, text: str) -> None:
    flight = flown_to(Phase.APPROACH)
    flight.mode, flight.switched = "LOITER", switched
    flight.run(1)
    assert flight.texts[-1] == text


# ---- target, sinking, climbing ---------------------------------------------------------------------


def test_a_target_that_the_autopilot_has_lost_breaks_the_landing_off() -> None:
    flight = flown_to(Phase.FINAL).run(1)
    flight.target_lost_ns = flight.now_ns
    flight.run(0.3)
    assert flight.executive.tally.abort_reasons == ["target lost"]


def test_a_target_lost_below_the_commit_height_calls_nobody() -> None:
    """The autopilot lands straight down without it, and the vehicle is over the point."""
    flight = flown_to(Phase.FINAL).until(lambda f: f.position[2] < 1.0)
    flight.target_lost_ns = flight.now_ns
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert not [text for text in flight.texts if "take over" in text]


def test_a_target_lost_in_the_landing_before_does_not_count() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.target_lost_ns = 1
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_a_landing_that_climbs_is_broken_off() -> None:
    """PX4 climbs and searches when it has lost its target."""
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 6)
    flight.push = np.array([0.0, 0.0, 2.0])
    flight.run(2)
    assert flight.executive.tally.abort_reasons == ["climbs in landing"]


def test_the_jolt_of_the_change_to_land_breaks_nothing_off() -> None:
    flight = flown_to(Phase.FINAL)
    flight.push = np.array([0.0, 0.0, 1.8])
    flight.run(1)
    flight.push = np.zeros(3)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.CLIMB, Phase.HOLD])
def test_a_vehicle_that_sinks_unasked_calls_the_pilot(phase: Phase) -> None:
    flight = flown_to(phase).run(0.5)
    if phase is Phase.APPROACH:  # it waits over the point
        flight.state = lambda _height, _point: PointState.UNKNOWN
    flight.push = np.array([0.0, 0.0, -4.0])
    flight.run(3.5)
    assert flight.texts.count("SLZ: sinking: take over") == 1


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.HOLD])
def test_a_slow_sink_calls_the_pilot(phase: Phase) -> None:
    """0.16 m/s passed for a minute."""
    flight = flown_to(phase).run(6)
    flight.flown = np.array([0.0, 0.0, -0.16])
    flight.run(14)
    assert flight.texts.count("SLZ: sinking: take over") == 1


@pytest.mark.parametrize(
    ("phase", "reaction"),
    [
        (Phase.SURVEY, "SLZ: velocity not followed: take over"),
        (Phase.APPROACH, "SLZ: abort: velocity not followed"),
        (Phase.DESCEND, "SLZ: abort: velocity not followed"),
        (Phase.CLIMB, "SLZ: velocity not followed: take over"),
        (Phase.HOLD, "SLZ: velocity not followed: take over"),
    ],
)
def test_a_vehicle_that_flies_elsewhere_than_asked_has_a_reaction_in_every_phase(
    phase: Phase, reaction: str
) -> None:
    flight = flown_to(phase).run(0.5)
    flight.push = np.array([3.0, 5.0, 0.0])
    flight.run(3.8)
    assert flight.texts.count(reaction) == 1


@pytest.mark.parametrize("phase", GUIDED_PHASES)
def test_another_s_target_ends_the_commands_and_the_hand_over(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.commander = "255/190"
    flight.run(0.2)
    flight.commander, flight.velocity = "", np.zeros(3)
    assert flight.texts.count("SLZ: target of 255/190 flies, not ours: hands off") == 1
    first = len(flight.commands)
    flight.run(10)
    assert silent_since(flight, first)
    assert flight.executive.phase is Phase.IDLE


def test_a_descent_faster_than_asked_is_broken_off() -> None:
    flight = Flight([zone(1, 20, 0)], height=60.0).fly_to(Phase.DESCEND)
    flight.push = np.array([0.0, 0.0, -1.5])
    flight.run(4)
    assert flight.executive.tally.abort_reasons == ["sinking"]


# ---- the end ---------------------------------------------------------------------------------------


def test_the_target_is_streamed_until_the_vehicle_is_armed_again() -> None:
    """ArduPilot calls the end of the stream "Target Lost" at CRITICAL, even when it has disarmed."""
    flight = flown_to(Phase.FINAL).fly_to(Phase.LANDED)
    flight.run(2)
    flight.armed = False
    flight.run(2)
    assert flight.commands[-1][3].target_enu_m is not None
    flight.armed = True
    flight.run(0.2)
    assert flight.commands[-1][3].target_enu_m is None


def test_lifted_off_again_it_has_no_target() -> None:
    flight = flown_to(Phase.FINAL).fly_to(Phase.LANDED)
    flight.mode, flight.position[2] = "LOITER", 3.0
    flight.run(0.2)
    assert flight.commands[-1][3].target_enu_m is None


@pytest.mark.parametrize("blind", list(MissingInput))
def test_what_is_lost_is_called_by_its_name(blind: MissingInput) -> None:
    flight = flown_to(Phase.APPROACH)
    flight.lidar_ok, flight.lost = False, blind
    flight.run(12)
    assert f"SLZ: {blind.text}: holding" in flight.texts
    assert f"SLZ: {blind.thing} still {blind.state}: take over" in flight.texts


# ---- a vehicle that must not be commanded ----------------------------------------------------------

ON_THE_WING = "VTOL in fixed-wing flight"


@pytest.mark.parametrize("phase", [*GUIDED_PHASES, Phase.FINAL])
def test_a_vtol_that_flies_on_its_wing_is_left_alone_until_it_is_handed_over_again(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.no_command_reason = ON_THE_WING
    flight.run(1)
    assert flight.executive.phase is Phase.IDLE
    flight.mode, flight.velocity = "GUIDED", np.zeros(3)
    first = len(flight.commands)
    flight.run(40)
    assert silent_since(flight, first)
    assert [text for text in flight.texts if ON_THE_WING in text] == [f"SLZ: {ON_THE_WING}: hands off"]
    flight.no_command_reason = ""
    flight.run(10)
    assert silent_since(flight, first)
    assert "SLZ: the vehicle may be commanded now" in flight.texts
    assert f"SLZ: no hand-over: leave {flight.mode}, set it again" in flight.texts


def test_a_state_unknown_for_a_moment_after_an_outage_ends_no_landing() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.no_command_reason = "VTOL state unknown"
    flight.run(0.3)
    flight.no_command_reason = ""
    flight.fly_to(Phase.LANDED)
    assert not any("hands off" in text for text in flight.texts)


def test_a_fixed_wing_gets_no_command_by_any_order_and_is_told_once() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.no_command_reason = "fixed wing"
    flight.run(30)
    executive, situation = flight.executive, flight.situation()
    point = np.array([20.0, 0.0, 0.0])
    replies = [
        executive.orders.land_at_best(situation),
        executive.orders.land_in_zone(situation, 1),
        executive.orders.land_at_point(situation, point),
        executive.orders.land_now(situation),
    ]
    assert {(reply.accepted, reply.reason) for reply in replies} == {(False, "fixed wing: not commanded")}
    assert executive.orders.select_zone(situation, 1).accepted  # it is judged and shown
    flight.run(5)
    assert executive.orders.land_at_selected(flight.situation()).reason == "fixed wing: not commanded"
    flight.run(5)
    assert silent_since(flight, 0)
    assert flight.texts == ["SLZ: fixed wing: mapping only"]


def test_a_failsafe_that_takes_the_mode_or_loses_the_estimate_a_moment_later_is_one_event() -> None:
    """ArduPilot: the flags fall, 0.8 s later "EKF Failsafe"; a battery failsafe changes the mode last."""
    flight = flown_to(Phase.FINAL)
    first = len(flight.texts)
    flight.estimate_lost = "position"
    flight.run(0.8)
    flight.failsafe, flight.cause = True, "EKF Failsafe"
    flight.run(3)
    assert flight.texts[first:] == ["SLZ: failsafe (EKF Failsafe): LAND, take over"] or flight.texts[
        first:
    ] == ["SLZ: failsafe (position lost): LAND, take over"]
    flight = flown_to(Phase.FINAL)
    first = len(flight.texts)
    flight.failsafe, flight.cause = True, "Battery Failsafe"
    flight.run(0.5)
    flight.mode = "RTL"
    flight.run(3)
    assert flight.texts[first:] == ["SLZ: failsafe (Battery Failsafe): RTL, take over"]


@pytest.mark.parametrize(
    ("cause", "mode", "told"),
    [
        ("EKF Failsafe: changed to Land Mode", "LAND", "(EKF Failsafe): LAND"),
        ("position lost", "AUTO.LAND", "(position): AUTO.LAND"),
        ("Battery 1 low voltage", "RTL", "(Battery 1 low): RTL"),
    ],
)
def test_the_cause_of_a_failsafe_is_told_in_whole_words(cause: str, mode: str, told: str) -> None:
    flight = flown_to(Phase.DESCEND)
    flight.mode, flight.failsafe, flight.cause = mode, True, cause
    flight.run(2)
    assert flight.texts[-1] == f"SLZ: failsafe {told}, take over"


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.DESCEND, Phase.FINAL])
def test_a_glitch_of_gps_is_told_while_it_lasts(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.gps_glitching = True
    flight.run(3)
    assert flight.texts.count("SLZ: GPS glitch: position may jump, be ready") == 1
    assert flight.severities[-1] is Severity.CRITICAL
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
