"""Values that must not fly: named in the table, refused by one check."""

from __future__ import annotations

import pytest

import params
from params import ParameterError, airworthy, check_airworthy, grounded


@pytest.mark.parametrize("profile", params.PROFILES)
def test_every_profile_and_every_default_may_fly(profile: str) -> None:
    flown = params.load(profile)
    assert check_airworthy(flown) is flown
    assert airworthy(flown) == flown
    assert all(row.default not in row.grounded for row in params.rows())
    assert all(set(row.grounded) < set(row.choices) for row in params.rows() if row.grounded)


def test_all_grounded_values_are_refused_in_one_line_with_reason_and_remedy() -> None:
    given = params.load("quadcopter", ["odometry=autopilot", "mode=source"])
    assert [(one.row.name, one.value) for one in grounded(given)] == [
        ("mode", "source"),
        ("odometry", "autopilot"),
    ]
    with pytest.raises(ParameterError) as refused:
        check_airworthy(given)
    text = str(refused.value)
    assert "\n" not in text
    assert "an unobserved axis counts as observed" in text
    assert "use off or map" in text
    assert "use default" in text
    assert airworthy(given) == params.Parameters()


@pytest.mark.parametrize("row", [row for row in params.rows() if row.grounded], ids=lambda row: row.mavlink)
def test_what_the_pilot_reads_first_fits_one_message(row: params.Row) -> None:
    for value in row.grounded:
        assert len(f"SLZ: {row.mavlink}: {value} must not fly") <= 50
