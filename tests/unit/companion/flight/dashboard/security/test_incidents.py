"""Rate-limited log of strangers' attempts: count and origin."""

from __future__ import annotations

import pytest

from companion.flight.dashboard.security.incidents import (
    CROWDED_OUT,
    LINE_S,
    MOST_ADDRESSES,
    WRONG_TOKEN,
    Incidents,
)


def lines(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records]


def test_one_line_in_ten_seconds_says_how_many_and_from_where(caplog: pytest.LogCaptureFixture) -> None:
    now = [100.0]
    incidents = Incidents(lambda: now[0])
    for second in range(25):
        now[0] = 100.0 + second
        for _ in range(40):
            incidents.count(WRONG_TOKEN, "192.168.1.7")
        incidents.report()
    now[0] += LINE_S
    incidents.report()
    incidents.report()
    sizes = [40, 400, 400, 160]
    assert lines(caplog) == [f"page: {size} wrong tokens: {size} from 192.168.1.7" for size in sizes]


def test_kinds_have_lines_of_their_own_and_many_addresses_are_summed(
    caplog: pytest.LogCaptureFixture,
) -> None:
    incidents = Incidents(lambda: 0.0)
    for number in range(2 * MOST_ADDRESSES):
        incidents.count(CROWDED_OUT, f"10.0.0.{number}")
    for number in range(5):
        for _ in range(5 - number):
            incidents.count(WRONG_TOKEN, f"10.0.1.{number}")
    incidents.report()
    crowd, wrong = lines(caplog)
    assert crowd.startswith(f"page: {2 * MOST_ADDRESSES} connections ended to make room for others")
    assert f"{MOST_ADDRESSES} from others" in crowd
    assert wrong == (
        "page: 15 wrong tokens: 5 from 10.0.1.0, 4 from 10.0.1.1, 3 from 10.0.1.2 and 2 more addresses"
    )


def test_nothing_is_logged_where_nothing_happened(caplog: pytest.LogCaptureFixture) -> None:
    Incidents(lambda: 0.0).report()
    assert lines(caplog) == []
