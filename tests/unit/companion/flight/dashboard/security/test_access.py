"""Access rights of viewers and of users who may give orders."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.flight.dashboard.security.access import Access, Role, read_tokens
from companion.flight.dashboard.security.address import Address, bound, listen, parse_address
from companion.flight.dashboard.security.incidents import (
    CROWDED_OUT,
    LINE_S,
    MOST_ADDRESSES,
    WRONG_TOKEN,
    Incidents,
)
from companion.runtime.errors import UsageError

TOKENS = {"o" * 20: Role.OPERATOR, "v" * 20: Role.VIEWER}
HOME, ABROAD = Address("127.0.0.1", 8080), Address("0.0.0.0", 8080)
OWN = {"host": "127.0.0.1:8080", "origin": "http://127.0.0.1:8080"}


@pytest.mark.parametrize("text", ["8080", "host", ":80", "a:b", "a:65536", "a:-1", "[::1]"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="HOST:PORT"):
        parse_address(text)


def test_addresses_of_both_families_are_read() -> None:
    assert parse_address("[::1]:80") == Address("::1", 80)
    assert str(parse_address("[::1]:80")) == "[::1]:80"
    assert parse_address("127.0.0.1:0").is_loopback
    assert not parse_address("192.168.1.2:80").is_loopback
    assert not parse_address("0.0.0.0:80").is_loopback


def test_a_port_in_use_is_said_at_the_start() -> None:
    first = listen(Address("127.0.0.1", 0))
    with first, pytest.raises(UsageError, match="in use"):
        listen(bound(first))


def test_an_address_that_others_reach_needs_a_token() -> None:
    with pytest.raises(UsageError, match="--dashboard-token"):
        Access(ABROAD, None)
    assert Access(ABROAD, TOKENS).role(None) is None


def test_a_token_gives_its_role_and_no_other_does() -> None:
    access = Access(ABROAD, TOKENS)
    assert access.role("o" * 20) is Role.OPERATOR
    assert access.role("v" * 20) is Role.VIEWER
    assert [access.role(bad) for bad in (None, "", "o" * 19, "o" * 21, "é" * 20)] == [None] * 5


def test_on_this_computer_without_tokens_everybody_is_the_operator() -> None:
    assert Access(HOME, None).role(None) is Role.OPERATOR
    assert Access(HOME, TOKENS).role(None) is None


def test_orders_come_from_this_page_only() -> None:
    access = Access(HOME, None)
    assert access.refuses(OWN, acts=True) == ""
    assert "another site" in access.refuses({**OWN, "origin": "http://evil.example"}, acts=True)
    assert "another site" in access.refuses({**OWN, "origin": "null"}, acts=True)
    assert "another site" in access.refuses({**OWN, "origin": "http://127.0.0.1:9999"}, acts=True)
    assert "no Origin" in access.refuses({"host": OWN["host"]}, acts=True)


def test_another_name_for_this_computer_is_refused() -> None:
    """A web page could give this address a name of its own and then be of the same origin."""
    rebound = {"host": "evil.example:8080", "origin": "http://evil.example:8080"}
    assert "ask for this page as" in Access(HOME, None).refuses(rebound, acts=True)
    assert "ask for this page as" in Access(HOME, None).refuses(rebound, acts=False)


def test_a_page_of_another_site_may_link_here_but_not_read() -> None:
    access = Access(HOME, None)
    cross = {"host": OWN["host"], "sec-fetch-site": "cross-site"}
    assert access.refuses({**cross, "sec-fetch-mode": "no-cors"}, acts=False)
    assert access.refuses({**cross, "sec-fetch-mode": "navigate"}, acts=False) == ""
    assert access.refuses({**cross, "sec-fetch-mode": "navigate"}, acts=True)


def test_a_file_of_tokens_is_read(tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    file.write_text(f"# for the field\noperator {'o' * 20}\n\nviewer   {'v' * 20}\n")
    file.chmod(0o600)
    assert read_tokens(file) == TOKENS


@pytest.mark.parametrize(
    ("text", "mode", "said"),
    [
        ("operator short\n", 0o600, "line 1"),
        ("pilot " + "x" * 20, 0o600, "line 1"),
        ("operator " + "x" * 15 + "é\n", 0o600, "line 1"),
        ("\n# nothing\n", 0o600, "no token"),
        ("operator " + "x" * 20, 0o644, "chmod 600"),
    ],
)
def test_a_file_of_tokens_with_a_fault_is_refused(tmp_path: Path, text: str, mode: int, said: str) -> None:
    file = tmp_path / "tokens"
    file.write_text(text)
    file.chmod(mode)
    with pytest.raises(UsageError, match=said):
        read_tokens(file)


def test_a_missing_file_of_tokens_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        read_tokens(tmp_path / "none")


# Rate-limited log of strangers' attempts: count and origin.


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
