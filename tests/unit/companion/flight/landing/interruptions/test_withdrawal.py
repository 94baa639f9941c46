"""Withdrawal for a failsafe, a lost estimate, moved sticks, or a vehicle that must not be commanded."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.situation import Phase, Severity
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.statustext import CHUNK_BYTES
from tests.unit.companion.flight.landing.flight import GUIDED_PHASES, Flight, flown_to, zone


@pytest.mark.parametrize("below_m", [9.0, 1.2])
def test_a_stick_moved_in_the_landing_gives_the_vehicle_to_the_pilot(below_m: float) -> None:
    flight = flown_to(Phase.FINAL)
    flight.having(sticks_us=(1504, 1497)).until(lambda f: f.position[2] < below_m)
    flight.having(sticks_us=(1800, 1497)).run(0.5)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts[-1] == "SLZ: pilot moves the sticks in LAND: hands off"
    assert flight.executive.tally.hands_off == 1
    assert flight.silent_for(5)


def test_a_transmitter_that_rests_off_its_middle_or_twitches_is_no_pilot() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.having(sticks_us=(1620, 1380)).fly_to(Phase.FINAL)
    flight.having(sticks_us=(1650, 1350)).run(1)
    flight.having(sticks_us=(1740, 1350)).step()
    flight.having(sticks_us=(1620, 1380)).fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0


def test_a_stick_held_since_before_the_landing_is_the_pilot_s() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.having(sticks_us=(1800, 1500)).fly_to(Phase.FINAL).run(0.6)
    assert flight.executive.phase is Phase.IDLE
    assert flight.executive.tally.hands_off == 1


@pytest.mark.parametrize("broken", ["sticks", "estimate"])
def test_a_landing_that_wavers_about_the_commit_height_is_watched_all_the_same(broken: str) -> None:
    flight = flown_to(Phase.FINAL).having(sticks_us=(1500, 1500))
    flight.having(sinks=False).run(0.2)
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
    flight.having(sticks_us=(1500, 1500)).fly_to(phase)
    flight.having(sticks_us=(1900, 1500)).run(1)
    assert flight.executive.tally.hands_off == 0
    assert flight.executive.phase in (phase, Phase.APPROACH, Phase.DESCEND, Phase.FINAL)


@pytest.mark.parametrize("phase", [*GUIDED_PHASES, Phase.FINAL])
def test_a_mode_taken_by_the_autopilot_s_failsafe_is_not_the_pilot_s(phase: Phase) -> None:
    flight = flown_to(phase).having(mode="RTL", failsafe=True, cause="Battery 1 low voltage")
    first = len(flight.commands)
    flight.run(8)
    assert flight.executive.phase is Phase.FAILSAFE
    assert flight.is_silent_since(first)
    told = [text for text in flight.texts if "RTL" in text]
    assert told == ["SLZ: failsafe (Battery 1 low): RTL, take over"]
    assert Severity.CRITICAL in flight.severities
    assert flight.executive.tally.hands_off == 0
    assert flight.executive.tally.failsafes == ["Battery 1 low voltage"]


@pytest.mark.parametrize("mode", [max(ARDUPILOT.modes, key=len), max(PX4.modes, key=len), "AUTO.RTL"])
@pytest.mark.parametrize("cause", ["GPS lost", "x" * CHUNK_BYTES])
def test_every_text_about_a_failsafe_fits_one_statustext(mode: str, cause: str) -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(failsafe=True, cause=cause).run(1.5)
    flight.having(mode=mode).run(8)
    told = [text for text in flight.texts if "failsafe" in text]
    assert told[0].startswith("SLZ: failsafe (")
    assert told[0].endswith("): going on")
    assert told[1].startswith("SLZ: failsafe (")
    assert told[1].endswith(f"): {mode}, take over")
    assert max(map(len, told)) <= CHUNK_BYTES


def test_a_fence_breach_takes_the_mode_without_a_failsafe_state() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(mode="RTL", breached=True, cause="fence breached").run(1)
    assert flight.executive.phase is Phase.FAILSAFE
    assert "SLZ: failsafe (fence breached): RTL, take over" in flight.texts


@pytest.mark.parametrize("phase", [*GUIDED_PHASES, Phase.FINAL])
def test_a_lost_estimate_ends_all_commands_and_tells_the_pilot(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.having(estimate_lost="position").run(1.3)
    assert flight.executive.phase is Phase.FAILSAFE
    told = next(text for text in flight.texts if text.startswith("SLZ: failsafe"))
    assert told.startswith("SLZ: failsafe (position lost): ")
    assert told.endswith(", take over")
    assert flight.silent_for(10)


def test_an_estimate_lost_for_a_moment_changes_nothing() -> None:
    flight = flown_to(Phase.FINAL)
    flight.having(estimate_lost="velocity").run(0.6)
    flight.having(estimate_lost="").fly_to(Phase.LANDED)
    assert flight.executive.tally.failsafes == []


def test_a_failsafe_that_leaves_the_mode_to_us_is_told_once_and_the_landing_goes_on() -> None:
    flight = flown_to(Phase.DESCEND)
    flight.having(failsafe=True, cause="Battery 1 low voltage").fly_to(Phase.LANDED)
    told = [text for text in flight.texts if "failsafe" in text]
    assert told == ["SLZ: failsafe (Battery 1 low voltage): going on"]


def test_a_failsafe_that_is_told_after_its_mode_is_not_left_to_the_pilot() -> None:
    """PX4 tells of its mode at once, and of the failsafe with the next heartbeat."""
    flight = flown_to(Phase.DESCEND)
    flight.having(mode="AUTO.LAND").run(0.8)
    assert flight.texts[-1] == "SLZ: AUTO.LAND set, not by SLZ: hands off"
    flight.having(failsafe=True, cause="Failsafe activated").run(0.2)
    assert flight.executive.phase is Phase.FAILSAFE
    assert flight.texts[-1] == "SLZ: failsafe (Failsafe): AUTO.LAND, take over"
    assert (flight.executive.tally.hands_off, flight.executive.tally.failsafes) == (0, ["Failsafe activated"])


def test_a_failsafe_long_after_the_pilot_took_over_is_none_of_ours() -> None:
    flight = flown_to(Phase.DESCEND)
    flight.having(mode="LOITER").run(3)
    flight.having(failsafe=True).run(1)
    assert flight.executive.phase is Phase.IDLE
    assert flight.executive.tally.hands_off == 1


def test_a_gps_that_leaves_the_map_is_told_once() -> None:
    flight = flown_to(Phase.DESCEND, odometry="map")
    flight.having(tracked=True, gps_drift_m=0.7).run(1)
    assert not any("drifts" in text for text in flight.texts)
    flight.having(gps_drift_m=1.04).run(5)
    told = [text for text in flight.texts if "drifts" in text]
    assert told == ["SLZ: GPS drifts off the LiDAR, 1.0 m in 10 s"]


def test_each_further_mode_of_a_failsafe_is_told() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(mode="RTL", failsafe=True).run(2)
    flight.having(mode="LAND").run(2)
    assert flight.texts[-1] == "SLZ: failsafe: LAND, take over"


def test_after_a_failsafe_nothing_begins_without_a_new_hand_over() -> None:
    """PX4 returns to its guided mode by itself when setpoints arrive again."""
    flight = flown_to(Phase.APPROACH)
    flight.having(mode="POSCTL", failsafe=True).run(5)
    flight.having(mode="GUIDED", failsafe=False).run(20)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts[-1] == "SLZ: failsafe over: leave GUIDED, set it again"
    flight.having(mode="LOITER").run(2)
    flight.having(mode="GUIDED").fly_to(Phase.SURVEY)


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
    flight.having(mode="AUTO.LOITER", failsafe=True).run(5)
    flight.having(mode=mode, failsafe=False).run(5)
    assert flight.texts[-1] == f"SLZ: {told}"
    assert len(flight.texts[-1]) <= 50


def test_an_order_of_the_operator_hands_over_again() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(mode="RTL", failsafe=True).run(2)
    flight.having(mode="GUIDED", failsafe=False).run(2)
    assert flight.executive.orders.land_at_best(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)


@pytest.mark.parametrize("mode", ["GUIDED", "LOITER"])
def test_without_an_estimate_no_order_to_land_is_taken(mode: str) -> None:
    flight = Flight([zone(1, 20, 0)], auto=False).run(2).having(estimate_lost="position", mode=mode)
    order = flight.executive.orders.land_at_best if mode == "GUIDED" else flight.executive.orders.land_now
    reply = order(flight.situation())
    assert (reply.accepted, reply.reason) == (False, "position lost: fly by hand")


def test_down_by_a_failsafe_is_not_landed() -> None:
    flight = flown_to(Phase.FINAL)
    flight.having(estimate_lost="position").until(lambda f: f.position[2] < 0.05).run(2)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts[-1] == "SLZ: on the ground by the autopilot's failsafe"


def test_a_guided_mode_that_comes_back_by_itself_is_told_each_half_minute() -> None:
    flight = Flight([zone(1, 10, 0)])
    flight.having(mode="LOITER", failsafe=True).run(3)
    flight.having(mode="GUIDED", failsafe=False).run(70)
    assert flight.executive.phase is Phase.IDLE
    assert flight.texts.count("SLZ: no hand-over: leave GUIDED, set it again") == 3
    flight.having(mode="LOITER").run(1)
    flight.having(mode="GUIDED").fly_to(Phase.SURVEY)


def test_a_start_in_the_middle_of_a_failsafe_begins_nothing() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.having(mode="POSCTL", failsafe=True).run(3)
    flight.having(mode="GUIDED", failsafe=False).run(30)
    assert flight.phases == [Phase.IDLE]


ON_THE_WING = "VTOL in fixed-wing flight"


@pytest.mark.parametrize("phase", [*GUIDED_PHASES, Phase.FINAL])
def test_a_vtol_that_flies_on_its_wing_is_left_alone_until_it_is_handed_over_again(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.having(no_command_reason=ON_THE_WING).run(1)
    assert flight.executive.phase is Phase.IDLE
    flight.mode, flight.velocity = "GUIDED", np.zeros(3)
    first = len(flight.commands)
    flight.run(40)
    assert [text for text in flight.texts if ON_THE_WING in text] == [f"SLZ: {ON_THE_WING}: hands off"]
    flight.having(no_command_reason="").run(10)
    assert flight.is_silent_since(first)
    assert "SLZ: the vehicle may be commanded now" in flight.texts
    assert f"SLZ: no hand-over: leave {flight.mode}, set it again" in flight.texts


def test_a_state_unknown_for_a_moment_after_an_outage_ends_no_landing() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(no_command_reason="VTOL state unknown").run(0.3)
    flight.having(no_command_reason="").fly_to(Phase.LANDED)
    assert not any("hands off" in text for text in flight.texts)


def test_a_fixed_wing_gets_no_command_by_any_order_and_is_told_once() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.having(no_command_reason="fixed wing").run(30)
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
    assert flight.is_silent_since(0)
    assert flight.texts == ["SLZ: fixed wing: mapping only"]


def test_a_failsafe_that_takes_the_mode_or_loses_the_estimate_a_moment_later_is_one_event() -> None:
    """ArduPilot: the flags fall, 0.8 s later "EKF Failsafe"; a battery failsafe changes the mode last."""
    flight = flown_to(Phase.FINAL)
    first = len(flight.texts)
    flight.having(estimate_lost="position").run(0.8)
    flight.having(failsafe=True, cause="EKF Failsafe").run(3)
    assert flight.texts[first:] == ["SLZ: failsafe (EKF Failsafe): LAND, take over"] or flight.texts[
        first:
    ] == ["SLZ: failsafe (position lost): LAND, take over"]
    flight = flown_to(Phase.FINAL)
    first = len(flight.texts)
    flight.having(failsafe=True, cause="Battery Failsafe").run(0.5)
    flight.having(mode="RTL").run(3)
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
    flight.having(mode=mode, failsafe=True, cause=cause).run(2)
    assert flight.texts[-1] == f"SLZ: failsafe {told}, take over"
