"""Landings that the autopilot makes by itself: led to safe ground, by a target alone."""

from __future__ import annotations

import pytest

from tests.campaign.own_landings import Session

pytestmark = pytest.mark.long


def test_a_land_and_a_return_over_unsafe_ground_end_on_safe_ground_without_a_command() -> None:
    """The pilot's LAND beside a kerb; then the transmitter is lost, and home is beside one, too."""
    session = Session("streets", 1, "offer", ["land", "transmitter"], 2)
    landed = session.fly()
    assert [one.cause for one in landed] == ["land", "transmitter"]
    assert all(one.alone for one in landed), "the ground straight below is unsafe"
    assert [one.ended for one in landed] == ["", ""]
    summary = session.mission.companion.summary
    assert summary["assist"]["led"] == 2
    assert max(summary["assist"]["off_m"]) < 0.3
    assert session.mission.companion.deciding.execution.sent_enu_ms is None
