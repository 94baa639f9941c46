"""Offsets between the clocks of points and log, named where they are usual."""

from __future__ import annotations

import re

import pytest

from companion.desk.replay.time_of_day import fitting_offset

S = 1_000_000_000
BEGIN = 1_750_000_000
LOG = BEGIN * S, (BEGIN + 300) * S
WEEK, HOUR = 604_800, 3600


@pytest.mark.parametrize(
    ("early_s", "says"),
    [
        (1024 * WEEK, r"\+1 x 1024 weeks"),
        (2048 * WEEK, r"\+2 x 1024 weeks"),
        (-1024 * WEEK, "-1 x 1024 weeks"),
        (1024 * WEEK + 18, r"\+1 x 1024 weeks .* and \+18 s \(leap"),
        (315_964_800, r"\+1 x the epoch of GPS"),
        (315_964_800 - 18, r"\+1 x the epoch of GPS .* and -18 s \(leap"),
        (1_000_000_000, r"\+1 x 1e9 s"),
        (3 * WEEK, r"\+3 weeks"),
        (86_400, r"\+1 days"),
        (2 * HOUR, r"\+2 hours \(a time zone\)"),
        (-7 * HOUR, "-7 hours"),
        (HOUR * 5.5, r"\+22 quarters of an hour"),
        (777.0, r"\+777.0 s would fit"),
    ],
)
def test_the_offset_that_fits_is_named(early_s: float, says: str) -> None:
    points = LOG[0] + 10 * S - round(early_s * S), LOG[1] - 10 * S - round(early_s * S)
    assert re.search(says, fitting_offset(points, LOG))


def test_leap_seconds_are_named_where_the_log_is_as_long_as_the_points() -> None:
    points = LOG[0] - 18 * S, LOG[1] - 18 * S
    assert "+18 s (leap seconds)" in fitting_offset(points, LOG)
