"""Order of messages by the autopilot's time: late ones, copies, bad stamps and reboots."""

from __future__ import annotations

import heapq
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.link.clock.message_order import MessageOrder, Verdict, boot_step_ms

MS = 1_000_000
STEP_MS, KIND = 40, "ATTITUDE"
Arrival = tuple[int, int]  # ms of ours, boot time


def judged(
    arrivals: Iterable[Arrival], order: MessageOrder | None = None
) -> tuple[MessageOrder, list[Verdict]]:
    order, verdicts = order or MessageOrder(), []
    for at_ms, boot_ms in arrivals:
        order, verdict = order.judge(KIND, boot_ms, at_ms * MS)
        verdicts.append(verdict)
    return order, verdicts


def sent(begin_ms: int, end_ms: int, boot_ms: int = 60_000) -> list[Arrival]:
    """Return messages at 25 Hz, sent and received at once."""
    return [(at_ms, boot_ms + at_ms - begin_ms) for at_ms in range(begin_ms, end_ms, STEP_MS)]


@pytest.mark.parametrize("late_ms", [300, 900, 1500, 5000])
def test_copies_of_all_messages_are_old_and_no_reboot(late_ms: int) -> None:
    messages = sent(0, 25_000)
    copies = [(at_ms + late_ms + 1, boot_ms) for at_ms, boot_ms in messages]
    order, verdicts = judged(arrival for arrival in heapq.merge(messages, copies) if arrival[0] < 25_000)
    assert "restart" not in verdicts
    assert verdicts.count("next") == len(messages)
    assert (order.old > 0) == (late_ms > 1000)


def test_messages_seconds_late_in_no_order_are_no_reboot() -> None:
    messages = sent(0, 25_000)
    mixed = sorted(
        (at_ms + (n * 977 % 4000 + 1000 if n % 3 == 0 else 0), boot)
        for n, (at_ms, boot) in enumerate(messages)
    )
    assert "restart" not in judged(mixed)[1]


def test_a_boot_time_that_stays_low_for_five_seconds_is_a_reboot() -> None:
    order, verdicts = judged(sent(0, 5000) + sent(7000, 15_000, boot_ms=2000))
    assert verdicts.count("restart") == 1
    assert verdicts.count("old") == 125  # in 5 s
    assert order.newest_ms == 9960
    assert order.old == 0


def test_our_own_timesync_tells_a_reboot_at_once_and_that_there_is_none() -> None:
    order, _ = judged([*sent(0, 5000), (7000, 2000)])
    assert order.answered(2001, 7001 * MS)[1] == "restart"
    assert order.answered(2001, 7001 * MS)[0].newest_ms == 2001
    dismissed, verdict = order.answered(67_001, 7001 * MS)
    assert (verdict, dismissed.other, dismissed.old) == ("next", None, 1)


@pytest.mark.parametrize("bad_ms", [0, 1, 2**31, 2**32 - 1, 1_000_000])
def test_bad_stamps_are_old_amidst_good_ones_and_nothing_follows_from_a_first_one(bad_ms: int) -> None:
    amidst, verdicts = judged([*sent(0, 1000), (1001, bad_ms), (1002, bad_ms), *sent(1040, 2000, 61_040)])
    assert verdicts.count("old") == 2
    assert (amidst.newest_ms, amidst.other) == (61_960, None)
    first, verdicts = judged([(0, bad_ms), *sent(40, 2000)])
    assert "restart" not in verdicts
    assert first.newest_ms == 61_920
    assert set(verdicts) == {"next"}


def test_two_bad_stamps_far_from_each_other_are_no_time_that_goes_on() -> None:
    assert (
        "restart"
        not in judged([*sent(0, 1000), (1001, 0), (1002, 50_000), (1003, 20_000), (1004, 47_000)])[1]
    )


@pytest.mark.parametrize("gap_ms", [500, 3000, 60_000, 3_600_000])
def test_a_silence_or_a_simulator_ten_times_as_fast_is_no_reboot(gap_ms: int) -> None:
    boot_ms = 60_000 + 1000 + gap_ms
    assert set(judged(sent(0, 1000) + sent(1000 + gap_ms, 9000 + gap_ms, boot_ms))[1]) == {"next"}
    assert set(judged(sent(0, 1000) + sent(1000 + gap_ms, 9000 + gap_ms, 60_000 + 10 * gap_ms))[1]) == {
        "next"
    }


@given(st.integers(0, 2**32 - 1), st.integers(-(2**30), 2**30))
def test_boot_times_are_compared_across_their_overflow(boot_ms: int, step: int) -> None:
    assert boot_step_ms(boot_ms, (boot_ms + step) % 2**32) == step
