"""Registry of autopilots; tests/e2e/test_third_autopilot.py flies one that is added."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot
from companion.flight.link.autopilots.autopilot_registry import (
    add_autopilot,
    autopilot_of,
    registered_autopilots,
    remove_autopilot,
)
from companion.flight.link.autopilots.px4 import PX4

NUMBER = mavlink.MAV_AUTOPILOT_AUTOQUAD


def test_ours_are_found_by_their_heartbeats_and_no_other() -> None:
    assert registered_autopilots() == (ARDUPILOT, PX4)
    assert [autopilot_of(number) for number in (3, 12, NUMBER, 0)] == [ARDUPILOT, PX4, OTHER, OTHER]


def test_one_is_added_and_removed() -> None:
    third = Autopilot(name="third", mav_autopilot=NUMBER)
    add_autopilot(third)
    try:
        assert autopilot_of(NUMBER) is third
        with pytest.raises(ValueError, match="there already"):
            add_autopilot(third)
    finally:
        remove_autopilot(third)
    assert autopilot_of(NUMBER) is OTHER


@pytest.mark.parametrize(
    ("name", "number"),
    [("third", None), ("third", 12), ("px4", NUMBER), ("unknown", NUMBER), ("other", NUMBER)],
)
def test_one_without_a_number_or_with_another_s_is_refused(name: str, number: int | None) -> None:
    with pytest.raises(ValueError):
        add_autopilot(Autopilot(name=name, mav_autopilot=number))


@pytest.mark.parametrize("autopilot", registered_autopilots(), ids=str)
def test_its_modes_are_among_its_modes_and_each_has_another_number(autopilot: Autopilot) -> None:
    assert {autopilot.guided_mode, autopilot.landing_mode} <= set(autopilot.modes)
    assert len(set(autopilot.modes.values())) == len(autopilot.modes)
