"""Intruders at the page's port, from other addresses of this computer over real sockets."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from companion.flight.dashboard.security.http_connection import MOST_OF_ONE_HOST
from companion.flight.dashboard.security.throttle import LONGEST_S
from tests.unit.companion.flight.dashboard.test_server import (
    OPERATOR,
    VIEWER,
    Served,
    Waits,
    closed,
    heard,
    served,
    until_closed,
)
from tests.unit.companion.flight.dashboard.test_server import tokens as tokens

PILOT, STRANGER = "127.0.0.1", "127.0.0.2"
Held = list[tuple[asyncio.StreamReader, asyncio.StreamWriter]]


async def log_in(s: Served, token: str, sender: str) -> str:
    """Send the form of the page; return where the answer leads."""
    form = {"Origin": f"http://{s.host}", "Content_Type": "application/x-www-form-urlencoded"}
    code, _ = await s.http("/login", "POST", f"token={token}".encode(), sender=sender, **form)
    assert code == 303
    return next(line.split(" ")[1] for line in s.head.splitlines() if line.startswith("location:"))


async def guess(s: Served, sender: str, count: int, same: bool = False) -> None:
    """Try wrong tokens, in turn by the form and as programs do."""
    for number in range(count):
        token = "x" * 20 if same else f"x{number:019d}"
        if number % 2:
            assert await log_in(s, token, sender) == "/login?refused"
        else:
            code, _ = await s.http("/api/status", sender=sender, Authorization=f"Bearer {token}")
            assert code == 401


async def logged(caplog: pytest.LogCaptureFixture, text: str) -> list[str]:
    """Return the lines that have a text, as soon as there is one."""
    async with asyncio.timeout(10):
        while True:
            found = [r.getMessage() for r in caplog.records if text in r.getMessage()]
            if found:
                return found
            await asyncio.sleep(0)


@pytest.mark.parametrize("same", [False, True])
async def test_thirty_wrong_tokens_meet_a_growing_delay_and_leave_lines_in_the_log(
    tokens: Path, caplog: pytest.LogCaptureFixture, same: bool
) -> None:
    waits = Waits()
    async with served(tokens, waits) as s:
        await guess(s, STRANGER, 30, same)
        assert waits.seconds == [0.5, 1.0, 2.0, 4.0, *[LONGEST_S] * 23]
        waits.at_s += 10.0
        async with asyncio.timeout(10):
            while sum(int(line.split()[1]) for line in await logged(caplog, "wrong tokens")) < 30:
                await asyncio.sleep(0)
        lines = await logged(caplog, "wrong tokens")
        assert all(line.endswith(f" from {STRANGER}") for line in lines)
        assert len(lines) <= waits.at_s / 10.0 + 1


async def test_a_stranger_does_not_delay_the_pilot_of_another_address(tokens: Path) -> None:
    waits = Waits()
    async with served(tokens, waits) as s:
        await guess(s, STRANGER, 10)
        waits.seconds.clear()
        assert await log_in(s, OPERATOR, PILOT) == "/"
        async with s.connect(OPERATOR) as page:
            await heard(page, "state")
        assert waits.seconds == []


async def test_a_page_that_is_open_is_untouched_by_wrong_tokens_of_its_own_address(tokens: Path) -> None:
    """Behind one router, or a tunnel, all have the same address."""
    waits = Waits()
    async with served(tokens, waits) as s, s.connect(VIEWER) as page:
        await heard(page, "state")
        await guess(s, PILOT, 10)
        waits.seconds.clear()
        await heard(page, "state")
        assert (await s.http("/api/status", Cookie=f"slz-token={VIEWER}"))[0] == 200
        async with s.connect(VIEWER) as again:
            await heard(again, "state")
        assert waits.seconds == []


async def test_a_right_token_of_a_delayed_address_waits_once_and_the_operators_ends_the_delay(
    tokens: Path,
) -> None:
    waits = Waits()
    async with served(tokens, waits) as s:
        await guess(s, STRANGER, 20)
        waits.seconds.clear()
        for token in (VIEWER, VIEWER, OPERATOR, OPERATOR):
            assert await log_in(s, token, STRANGER) == "/"
        assert waits.seconds == [LONGEST_S, LONGEST_S]  # whoever may look does not guess the rest for nothing
        await guess(s, STRANGER, 3)
        assert waits.seconds == [LONGEST_S, LONGEST_S]


async def test_of_many_guesses_at_once_a_few_wait_and_the_others_are_not_judged(
    tokens: Path, caplog: pytest.LogCaptureFixture
) -> None:
    go_on = asyncio.Event()

    class Held(Waits):
        async def sleep(self, seconds: float) -> None:
            await super().sleep(0.0)
            while not go_on.is_set():
                await asyncio.sleep(0)

    waits = Held()
    async with served(tokens, waits) as s:
        try:
            await guess(s, STRANGER, 3)
            asked = [
                asyncio.create_task(s.http("/", sender=STRANGER, Authorization=f"Bearer {number:020d}"))
                for number in range(20)
            ]
            done: list[int] = []
            async with asyncio.timeout(10):
                for answer in asyncio.as_completed(asked):
                    done.append((await answer)[0])
                    if done.count(429) == 16:
                        break
            assert done == [429] * 16
            assert await log_in(s, "y" * 20, STRANGER) == "/login?wait"
            assert (await s.http("/api/status", Cookie=f"slz-token={OPERATOR}"))[0] == 200
            assert "17" in "".join(await logged(caplog, "refused unread")) or s.front.token_check.incidents
        finally:
            go_on.set()
        assert sorted([(await one)[0] for one in asked]) == [303] * 4 + [429] * 16


@asynccontextmanager
async def held_by(s: Served, senders: list[str], of_each: int) -> AsyncIterator[Held]:
    """Hold connections on which a request was begun and never ends."""
    held: Held = []
    for number in range(of_each):
        for sender in senders:
            held.append(await s.open(sender))
            held[-1][1].write(b"GET / HT" if number % 2 else b"")
    try:
        yield held
    finally:
        await closed(*(writer for _, writer in held))


@pytest.mark.parametrize("sender", [PILOT, STRANGER])
async def test_three_hundred_unfinished_connections_shut_out_nobody(
    tokens: Path, caplog: pytest.LogCaptureFixture, sender: str
) -> None:
    async with served(tokens) as s, s.connect(VIEWER, STRANGER) as page, held_by(s, [STRANGER], 300) as held:
        assert (await s.http("/api/status", sender=sender, Cookie=f"slz-token={OPERATOR}"))[0] == 200
        assert await log_in(s, OPERATOR, sender) == "/"
        await heard(page, "state")
        assert f"from {STRANGER}" in (await logged(caplog, "ended to make room"))[0]
        for reader, _ in held[: 300 - MOST_OF_ONE_HOST]:
            assert await until_closed(reader) == b""
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0):
                await held[-1][0].read()


async def test_strangers_of_many_addresses_replace_each_other_and_not_the_pilot(
    monkeypatch: pytest.MonkeyPatch, tokens: Path
) -> None:
    """With room for 64 connections, for time: of each address fewer than one may have."""
    monkeypatch.setattr("companion.flight.dashboard.security.http_connection.MOST_CONNECTIONS", 64)
    strangers = [f"127.0.1.{number}" for number in range(1, 9)]
    async with served(tokens) as s, s.connect(VIEWER, "127.0.0.9") as page:
        idle_reader, idle = await s.open(PILOT)
        idle.write(f"GET /api/status HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {VIEWER}\r\n\r\n".encode())
        assert (await idle_reader.readline()).startswith(b"HTTP/1.1 200")
        async with held_by(s, strangers, 2 * 64 // len(strangers)):
            for sender in (PILOT, "127.0.0.3", strangers[0]):
                assert (await s.http("/login", sender=sender))[0] == 200
            await heard(page, "state")
            idle.write(b"GET /login HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
            async with asyncio.timeout(10):
                assert b"HTTP/1.1 200" in await idle_reader.read()
        await closed(idle)


async def test_where_everybody_is_in_use_the_newcomer_waits_outside(
    monkeypatch: pytest.MonkeyPatch, tokens: Path
) -> None:
    monkeypatch.setattr("companion.flight.dashboard.security.http_connection.MOST_OF_ONE_HOST", 2)
    async with served(tokens) as s, s.connect(VIEWER, STRANGER) as one, s.connect(VIEWER, STRANGER) as two:
        reader, writer = await s.open(STRANGER)
        assert await until_closed(reader) == b""
        await closed(writer)
        for page in (one, two):
            await heard(page, "state")
        assert (await s.http("/login", sender=PILOT))[0] == 200


async def test_an_address_that_a_stranger_writes_into_a_header_counts_for_nothing(
    tokens: Path, caplog: pytest.LogCaptureFixture
) -> None:
    waits = Waits()
    async with served(tokens, waits) as s:
        for number in range(5):
            lie = {"X_Forwarded_For": f"10.0.0.{number}", "Authorization": f"Bearer {number:020d}"}
            await s.http("/api/status", sender=PILOT, **lie)
        assert waits.seconds == [0.5, 1.0]
        assert "10.0.0" not in "".join(await logged(caplog, "wrong tokens"))
