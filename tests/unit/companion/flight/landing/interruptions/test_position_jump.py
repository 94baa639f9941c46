"""Jumps of the position estimate: the vehicle stays, and stored places follow."""

from __future__ import annotations

import pytest

from companion.flight.landing.situation import Phase
from tests.unit.companion.flight.landing.flight import Flight, zone


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH])
def test_a_jump_of_the_estimated_height_does_not_move_the_vehicle(phase: Phase) -> None:
    flight = Flight([zone(1, 80, 0)]).fly_to(phase).run(1)
    flight.jump(0, 0, 12.0)
    flight.run(10)
    assert flight.position[2] == pytest.approx(30, abs=0.5)


def test_a_jump_in_the_approach_does_not_move_the_place_it_flies_to() -> None:
    flight = Flight([zone(1, 40, 0)]).fly_to(Phase.APPROACH).run(1)
    flight.jump(9.0, -4.0, 1.0)
    flight.fly_to(Phase.LANDED)
    assert flight.position[:2] == pytest.approx([40, 0], abs=0.5)
    assert flight.executive.tally.aborts == 0


def test_a_jump_below_commit_height_does_not_move_the_target_away_from_the_vehicle() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.2)
    flight.jump(5.0, 0, 3.0)
    commands = flight.step()
    assert commands.target_enu_m is not None
    assert commands.target_enu_m - flight.estimate_is_off_m == pytest.approx([10, 0, 0], abs=0.2)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_a_reboot_without_a_jump_leaves_the_place_it_flies_to() -> None:
    """It braked while nothing was heard: that it is not where its speed would have led is no jump."""
    flight = Flight([zone(1, 80, 0)]).fly_to(Phase.APPROACH).run(4)
    flight.having(blind=True).run(2)
    flight.jump(0, 0, 0)
    flight.having(blind=False).fly_to(Phase.LANDED)
    assert flight.position[:2] == pytest.approx([80, 0], abs=0.2)


def test_a_jump_found_after_a_gap_moves_the_place_it_flies_to() -> None:
    flight = Flight([zone(1, 80, 0)]).fly_to(Phase.APPROACH).run(4)
    flight.having(blind=True).run(1)
    flight.jump(0, 9, 0)
    flight.having(blind=False).fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(80, abs=4)
    assert flight.position[1] == pytest.approx(0, abs=0.2)


@pytest.mark.parametrize("aborted", [False, True])
def test_a_selection_lost_with_the_map_is_said_to_be_lost_and_another_can_be_made(aborted: bool) -> None:
    flight = Flight([zone(1, 20, 0), zone(2, -10, 0)], auto=aborted)
    if aborted:
        flight.fly_to(Phase.DESCEND)
        flight.executive.orders.abort(flight.situation())
        flight.run(10)
    assert flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.run(2)
    flight.jump(5.0, 0, 0)
    flight.run(5)
    assert flight.texts[-1] == "SLZ: selection lost: select again"
    assert flight.texts.count("SLZ: selection lost: select again") == 1
    assert flight.executive.orders.land_at_selected(flight.situation()).reason == "nothing selected"
    assert flight.executive.orders.select_zone(flight.situation(), 1).accepted
    flight.run(2)
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.APPROACH)


def test_a_jump_without_a_selection_loses_none() -> None:
    flight = Flight([zone(1, 20, 0)], auto=False).run(1)
    flight.jump(5.0, 0, 0)
    assert flight.run(1).texts == []
