"""TimeSync: recovery of offset and drift through delay, loss, jumps and reboots; scripts, no sockets."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import pairwise

import pytest

from companion.flight.link.clock.autopilot_clock import AutopilotClock
from companion.flight.link.clock.timesync import TimeSync, answer
from companion.flight.link.link_statistics import quantile_ms

MS = 1_000_000
S = 1_000_000_000
Delays = Callable[[random.Random], tuple[float, float]]


def quick(_: random.Random) -> tuple[float, float]:
    return 1 * MS, 1 * MS


def jittery(rng: random.Random) -> tuple[float, float]:
    """Two milliseconds each way, and queues of up to 40 ms that strike one direction at a time."""
    there, back = (2 * MS + rng.expovariate(1) * 0.2 * MS for _ in range(2))
    queue = rng.uniform(0, 40 * MS) if rng.random() < 0.5 else 0.0
    return (there + queue, back) if rng.random() < 0.5 else (there, back + queue)


def exchange(
    sync: TimeSync,
    begin_ns: int,
    seconds: float,
    autopilot: Callable[[float], float],
    delays: Delays = quick,
    seed: int = 1,
    loss: float = 0.0,
) -> int:
    """Let both sides talk; `autopilot` maps our time to its clock. Return the time reached."""
    rng = random.Random(seed)
    now = begin_ns
    while now < begin_ns + seconds * S:
        stamp = sync.request(now)
        if stamp is not None and rng.random() >= loss:
            there, back = delays(rng)
            sync.reply(round(autopilot(now + there)), stamp, round(now + there + back))
        now += 50 * MS
    return now


def test_it_asks_five_times_a_second_at_first_and_once_a_second_then() -> None:
    sync = TimeSync()
    times = [t for t in range(0, 20 * S, 10 * MS) if sync.request(t) is not None]
    gaps = [b - a for a, b in pairwise(times)]
    assert gaps[:20] == [200 * MS] * 20
    assert gaps[-5:] == [S] * 5


def test_a_constant_offset_is_found_exactly_on_a_symmetric_link() -> None:
    sync = TimeSync()
    now = exchange(sync, 1000 * S, 3, lambda t: t - 900 * S)
    assert sync.synced
    assert abs(sync.to_local_ns(now - 900 * S) - now) <= 2
    assert abs(sync.to_autopilot_ns(now) - (now - 900 * S)) <= 2
    assert sync.residual_ns < 1000


@pytest.mark.parametrize("seed", range(5))
def test_queues_in_one_direction_do_not_pull_the_offset(seed: int) -> None:
    sync = TimeSync()
    now = exchange(sync, 10 * S, 30, lambda t: t + 5 * S, jittery, seed)
    assert abs(sync.to_local_ns(now + 5 * S) - now) < 1 * MS


@pytest.mark.parametrize("ppm", [-100, 40, 100])
def test_drift_is_followed_and_extrapolated_through_silence(ppm: int) -> None:
    sync = TimeSync()
    rate = 1 - ppm * 1e-6

    def autopilot(t: float) -> float:
        return 7 * S + (t - 50 * S) * rate

    now = exchange(sync, 50 * S, 60, autopilot, jittery, seed=3, loss=0.3)
    later = now + 20 * S
    assert sync.drift_ppm == pytest.approx(ppm, abs=25)
    assert abs(sync.to_local_ns(round(autopilot(later))) - later) < 1.5 * MS


def test_there_and_back_is_the_identity_under_drift() -> None:
    sync = TimeSync()
    now = exchange(sync, 50 * S, 60, lambda t: 7 * S + t * 0.95)
    for at in (now - S, now, now + S):
        assert abs(sync.to_local_ns(sync.to_autopilot_ns(at)) - at) <= 2000


def test_a_jump_of_the_autopilot_s_clock_is_followed_after_three_exchanges() -> None:
    sync = TimeSync()
    now = exchange(sync, 10 * S, 20, lambda t: t)
    now = exchange(sync, now, 6, lambda t: t + 100 * MS)
    assert sync.resets == 1
    assert sync.synced
    assert abs(sync.to_local_ns(now + 100 * MS) - now) < 100


@pytest.mark.parametrize("jump_ms", [-50, 30, 400])
def test_a_jump_is_asked_after_at_once_and_no_stamp_is_wrong_for_long(jump_ms: int) -> None:
    """Stamps lie where they were, or where the jump moved them, from a second and a half on."""
    clock = AutopilotClock()

    def autopilot(t: float) -> float:
        return t - 9 * S + (jump_ms * MS if t >= 40 * S else 0)

    now, wrong_s = 10 * S, 0.0
    while now < 50 * S:
        now = exchange(clock.timesync, now, 0.02, autopilot)
        boot_ms = round(autopilot(now) / MS)
        stamp = clock.stamp_ns(boot_ms, now + 5 * MS)
        if stamp is not None and now > 20 * S and abs(stamp - now) > 6 * MS:
            wrong_s = (now - 40 * S) / S
    assert clock.timesync.resets >= 1
    assert wrong_s < 1.6
    assert stamp is not None


def test_one_wrong_answer_is_no_jump() -> None:
    sync = TimeSync()
    now = exchange(sync, 10 * S, 20, lambda t: t)
    while (stamp := sync.request(now)) is None:
        now += 50 * MS
    sync.reply(now + 3 * S, stamp, now + 2 * MS)
    now = exchange(sync, now, 5, lambda t: t)
    assert sync.resets == 0
    assert abs(sync.to_local_ns(now) - now) < 100


def test_answers_to_others_and_repeated_ones_are_counted_and_ignored() -> None:
    sync = TimeSync()
    stamp = sync.request(S)
    assert stamp is not None
    sync.reply(5 * S, 12345, S + MS)
    sync.reply(5 * S, stamp, S + MS)
    sync.reply(9 * S, stamp, S + 2 * MS)
    assert sync.strays == 2
    assert not sync.synced


def test_nothing_is_mapped_before_enough_answers() -> None:
    with pytest.raises(ValueError, match="not synchronised"):
        TimeSync().to_local_ns(5)


def test_a_request_is_answered_with_our_time_and_a_reply_is_not() -> None:
    assert answer(0, 77, 5 * S) == (5 * S, 77)
    assert answer(0, 77, 0) == (1, 77)
    assert answer(3, 77, 5 * S) is None


def test_before_timesync_the_quickest_arrival_sets_the_clock() -> None:
    clock = AutopilotClock()
    assert clock.source == "none"
    for n, delay_ms in enumerate([30, 5, 80, 12, 60]):
        boot_ms = 1000 + 20 * n
        stamp = clock.stamp_ns(boot_ms, (boot_ms + 50_000 + delay_ms) * MS)
    assert clock.source == "arrival"
    assert stamp == (1080 + 50_000 + 5) * MS


def test_the_quickest_arrival_is_forgotten_when_clocks_drift_apart() -> None:
    clock = AutopilotClock()
    for boot_ms in range(0, 200_000, 100):
        arrival = 5 * S + round(boot_ms * MS * 1.001)
        stamp = clock.stamp_ns(boot_ms, arrival)
    assert stamp is not None
    assert 0 <= arrival - stamp <= 30 * MS + 1


def test_synchronised_stamps_do_not_depend_on_the_delay_of_the_message() -> None:
    clock = AutopilotClock()
    now = exchange(clock.timesync, 10 * S, 5, lambda t: t - 9 * S)
    for delay in (0, 30 * MS, 400 * MS):
        assert clock.source == "timesync"
        assert clock.stamp_ns((now - 9 * S) // MS, now + delay) == pytest.approx(now, abs=100)


@pytest.mark.parametrize("answered", [True, False])
@pytest.mark.parametrize("turns", [0, 1, 2])
def test_boot_times_that_go_round_after_seven_weeks_are_placed_as_before(answered: bool, turns: int) -> None:
    clock, now = AutopilotClock(), 10 * S
    ahead = turns * 2**32 * MS - 30 * S  # switched on a second ago, or goes round in 20 s
    ahead += 21 * S if turns == 0 else 0
    while now < 60 * S:
        now = exchange(clock.timesync, now, 0.1, lambda t: t + ahead) if answered else now + 100 * MS
        stamp = clock.stamp_ns((now + ahead) // MS % 2**32, now + 3 * MS)
        assert stamp == pytest.approx(now, abs=4 * MS)
    assert (clock.implausible, clock.timesync.resets) == (0, 0)


def test_stamps_from_the_future_are_refused_and_many_of_them_start_the_clock_over() -> None:
    clock = AutopilotClock()
    now = exchange(clock.timesync, 10 * S, 5, lambda t: t - 9 * S)
    boot_ms = (now - 9 * S) // MS + 60_000
    results = [clock.stamp_ns(boot_ms + n, now + n * MS) for n in range(21)]
    assert results[:20] == [None] * 20
    assert results[20] == now + 20 * MS
    assert (clock.implausible, clock.source) == (20, "arrival")


def test_a_look_up_neither_teaches_the_clock_nor_starts_it_over() -> None:
    clock = AutopilotClock()
    assert clock.look_up_ns(1000, 10 * S) is None
    clock.stamp_ns(1000, 10 * S)
    assert clock.look_up_ns(900, 10 * S) == 10 * S - 100 * MS
    now = exchange(clock.timesync, 10 * S, 5, lambda t: t - 9 * S)
    boot_ms, unix_ms = (now - 9 * S) // MS, 1_790_000_000_000
    assert clock.look_up_ns(boot_ms, now + 30 * MS) == pytest.approx(now, abs=100)
    delays = len(clock.delays_ns)
    assert [clock.look_up_ns(unix_ms + n, now + n * MS) for n in range(50)] == [None] * 50
    assert (clock.source, clock.implausible, len(clock.delays_ns)) == ("timesync", 0, delays)


def test_what_was_long_under_way_is_seen_in_the_delays_once_clocks_are_synchronised() -> None:
    clock = AutopilotClock()
    clock.stamp_ns(1000, 10 * S)
    assert quantile_ms(clock.delays_ns, 0.5) is None
    now = exchange(clock.timesync, 10 * S, 5, lambda t: t - 9 * S)
    for number in range(100):
        boot_ms = (now - 9 * S) // MS + number
        clock.stamp_ns(boot_ms, (boot_ms + 9000) * MS + (200 if number == 50 else 4) * MS)
    assert quantile_ms(clock.delays_ns, 0.5) == pytest.approx(4.0, abs=1.1)
    assert quantile_ms(clock.delays_ns, 0.99) == pytest.approx(200.0, abs=1.1)
    assert clock.timesync.worst_residual_ns >= clock.timesync.residual_ns
    clock.reset()
    assert not clock.delays_ns


@pytest.mark.parametrize(("there_ns", "tc1"), [(-1, 9 * S), (3600 * S, 9 * S), (5 * MS, 0), (5 * MS, -4)])
def test_an_answer_that_came_before_it_was_asked_for_or_tells_no_time_counts_for_nothing(
    there_ns: int, tc1: int
) -> None:
    sync = TimeSync()
    for at in range(20):
        now = 100 * S + at * S
        stamp = sync.request(now)
        assert stamp is not None
        sync.reply(tc1, stamp, now + there_ns)
    assert not sync.synced
    assert sync.round_trip_ns == 0


def test_without_exchanges_there_is_no_other_time() -> None:
    sync = TimeSync()
    with pytest.raises(ValueError, match="not synchronised yet"):
        sync.to_local_ns(S)
    with pytest.raises(ValueError, match="not synchronised yet"):
        sync.to_autopilot_ns(S)


def test_exchanges_around_one_moment_that_contradict_each_other_are_no_drift() -> None:
    sync = TimeSync()
    sent = [k * 200 * MS for k in range(5)]
    stamps = [sync.request(at) for at in sent]
    for k in reversed(range(5)):  # the later it was asked for, the sooner an answer comes
        stamp = stamps[k]
        assert stamp is not None
        sync.reply((10 + 5 * k) * S, stamp, 1800 * MS - sent[k])
    assert sync.synced
    assert sync.drift_ppm == 0.0
    assert sync.to_local_ns(20 * S) == 900 * MS
