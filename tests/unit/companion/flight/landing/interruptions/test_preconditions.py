"""Preconditions of each stage of a landing about the vehicle: the table, and each reaction flown."""

from __future__ import annotations

import re

import numpy as np
import pytest

from companion.flight.landing.interruptions.preconditions import TABLE, Precondition, Reaction, Stage
from companion.flight.landing.situation import Phase, Severity
from slz import PointState
from tests import REPOSITORY
from tests.unit.companion.flight.landing.flight import GUIDED_PHASES, Flight, flown_to, zone
from tests.unit.docs.said import templates

DOCS = REPOSITORY / "docs" / "reactions.md"


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


def test_a_landing_pushed_off_the_point_is_broken_off() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 9)
    flight.having(push=np.array([0.8, 0.0, 0.0])).fly_to(Phase.CLIMB)
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
    flight.having(estimate_is_off_m=np.array([0.7, 0.0, 0.0]), sinks=False).run(5)
    assert not [text for text in flight.texts if "take over" in text]


def test_lower_than_the_point_it_does_not_stand_on_it() -> None:
    """It slides off a roof, or its estimate is too low."""
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 0.1)
    flight.position[2] = 0.06
    flight.having(estimate_is_off_m=np.array([0.7, 0.0, -0.5]), sinks=False).run(5)
    assert [text for text in flight.texts if "off the point: take over" in text]


def test_below_commit_height_the_pilot_is_told_how_far_off_it_lands() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.3)
    flight.having(push=np.array([1.0, 0.0, 0.0])).fly_to(Phase.LANDED)
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


def test_a_target_that_the_autopilot_has_lost_breaks_the_landing_off() -> None:
    flight = flown_to(Phase.FINAL).run(1)
    flight.having(target_lost_ns=flight.now_ns).run(0.3)
    assert flight.executive.tally.abort_reasons == ["target lost"]


def test_a_target_lost_below_the_commit_height_calls_nobody() -> None:
    """The autopilot lands straight down without it, and the vehicle is over the point."""
    flight = flown_to(Phase.FINAL).until(lambda f: f.position[2] < 1.0)
    flight.having(target_lost_ns=flight.now_ns).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert not [text for text in flight.texts if "take over" in text]


def test_a_target_lost_in_the_landing_before_does_not_count() -> None:
    flight = Flight([zone(1, 20, 0)])
    flight.having(target_lost_ns=1).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_a_landing_that_climbs_is_broken_off() -> None:
    """PX4 climbs and searches when it has lost its target."""
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 6)
    flight.having(push=np.array([0.0, 0.0, 2.0])).run(2)
    assert flight.executive.tally.abort_reasons == ["climbs in landing"]


def test_the_jolt_of_the_change_to_land_breaks_nothing_off() -> None:
    flight = flown_to(Phase.FINAL)
    flight.having(push=np.array([0.0, 0.0, 1.8])).run(1)
    flight.having(push=np.zeros(3)).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.CLIMB, Phase.HOLD])
def test_a_vehicle_that_sinks_unasked_calls_the_pilot(phase: Phase) -> None:
    flight = flown_to(phase).run(0.5)
    if phase is Phase.APPROACH:  # it waits over the point
        flight.state = lambda _height, _point: PointState.UNKNOWN
    flight.having(push=np.array([0.0, 0.0, -4.0])).run(3.5)
    assert flight.texts.count("SLZ: sinking: take over") == 1


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.HOLD])
def test_a_slow_sink_calls_the_pilot(phase: Phase) -> None:
    """0.16 m/s passed for a minute."""
    flight = flown_to(phase).run(6)
    flight.having(flown=np.array([0.0, 0.0, -0.16])).run(14)
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
    flight.having(push=np.array([3.0, 5.0, 0.0])).run(3.8)
    assert flight.texts.count(reaction) == 1


@pytest.mark.parametrize("phase", GUIDED_PHASES)
def test_another_s_target_ends_the_commands_and_the_hand_over(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.having(commander="255/190").run(0.2)
    flight.commander, flight.velocity = "", np.zeros(3)
    assert flight.texts.count("SLZ: target of 255/190 flies, not ours: hands off") == 1
    assert flight.silent_for(10)
    assert flight.executive.phase is Phase.IDLE


def test_a_descent_faster_than_asked_is_broken_off() -> None:
    flight = Flight([zone(1, 20, 0)], height=60.0).fly_to(Phase.DESCEND)
    flight.having(push=np.array([0.0, 0.0, -1.5])).run(4)
    assert flight.executive.tally.abort_reasons == ["sinking"]


def test_the_target_is_streamed_until_the_vehicle_is_armed_again() -> None:
    """ArduPilot calls the end of the stream "Target Lost" at CRITICAL, even when it has disarmed."""
    flight = flown_to(Phase.FINAL).fly_to(Phase.LANDED)
    flight.run(2)
    flight.having(armed=False).run(2)
    assert flight.commands[-1][3].target_enu_m is not None
    flight.having(armed=True).run(0.2)
    assert flight.commands[-1][3].target_enu_m is None


def test_lifted_off_again_it_has_no_target() -> None:
    flight = flown_to(Phase.FINAL).fly_to(Phase.LANDED)
    flight.mode, flight.position[2] = "LOITER", 3.0
    flight.run(0.2)
    assert flight.commands[-1][3].target_enu_m is None


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.DESCEND, Phase.FINAL])
def test_a_glitch_of_gps_is_told_while_it_lasts(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.having(gps_glitching=True).run(3)
    assert flight.texts.count("SLZ: GPS glitch: position may jump, be ready") == 1
    assert flight.severities[-1] is Severity.CRITICAL
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
