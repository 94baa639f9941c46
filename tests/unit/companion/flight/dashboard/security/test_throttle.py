"""Growth of the delay after wrong tokens, and the clients it applies to."""

from __future__ import annotations

import pytest

from companion.flight.dashboard.security.throttle import (
    FORGET_S,
    FREE,
    LONGEST_S,
    MOST_ADDRESSES,
    MOST_WAITING,
    Throttle,
    TooManyGuessesError,
)

A, B = "192.168.1.7", "192.168.1.8"


class Clock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


def guessed(throttle: Throttle, address: str, count: int) -> None:
    for number in range(count):
        throttle.count_wrong(address, b"%d" % number)


def test_the_delay_grows_with_wrong_tokens_up_to_a_longest_one() -> None:
    throttle, found = Throttle(Clock()), []
    for number in range(12):
        found.append(throttle.delay_s(A, b"%d" % number))
        throttle.count_wrong(A, b"%d" % number)
    assert found == [0.0] * FREE + [0.5, 1.0, 2.0, 4.0] + [LONGEST_S] * 5


def test_another_address_is_not_concerned() -> None:
    throttle = Throttle(Clock())
    guessed(throttle, A, 100)
    assert throttle.delay_s(A, b"new") == LONGEST_S
    assert throttle.delay_s(B, b"new") == 0.0


def test_the_same_wrong_token_again_and_again_delays_itself_and_no_other() -> None:
    """A page that was left open brings the token of another day every few seconds."""
    throttle = Throttle(Clock())
    for _ in range(30):
        throttle.count_wrong(A, b"yesterday's")
    assert throttle.delay_s(A, b"yesterday's") == LONGEST_S
    assert throttle.delay_s(A, b"today's") == 0.0


def test_time_ends_the_delay_and_so_does_a_right_token() -> None:
    clock = Clock()
    throttle = Throttle(clock)
    guessed(throttle, A, 10)
    clock.s = FORGET_S
    assert throttle.delay_s(A, b"new") == LONGEST_S
    clock.s = FORGET_S + 1.0
    assert throttle.delay_s(A, b"new") == 0.0
    guessed(throttle, A, 10)
    throttle.forget(A)
    assert throttle.delay_s(A, b"new") == 0.0


def test_tokens_that_wait_count_too_so_that_guesses_at_once_gain_nothing() -> None:
    throttle = Throttle(Clock())
    guessed(throttle, A, FREE)
    assert throttle.delay_s(A, b"a") == 0.5
    with throttle.waiting(A, b"a"):
        assert throttle.delay_s(A, b"b") == 1.0
    assert throttle.delay_s(A, b"b") == 0.5


def test_a_few_tokens_of_an_address_wait_and_the_same_one_once() -> None:
    throttle = Throttle(Clock())
    waits = [throttle.waiting(A, b"%d" % number) for number in range(MOST_WAITING)]
    waits[0].__enter__()
    with pytest.raises(TooManyGuessesError), throttle.waiting(A, b"0"):
        pass
    for one in waits[1:]:
        one.__enter__()
    with pytest.raises(TooManyGuessesError), throttle.waiting(A, b"another"):
        pass
    with throttle.waiting(B, b"another"):
        pass
    waits[0].__exit__(None, None, None)
    with throttle.waiting(A, b"another"):
        pass


def test_the_memory_is_bounded_and_the_newest_addresses_are_kept() -> None:
    throttle = Throttle(Clock())
    addresses = [f"10.0.{number // 256}.{number % 256}" for number in range(MOST_ADDRESSES + 50)]
    for address in addresses:
        guessed(throttle, address, 10)
    delayed = [address for address in addresses if throttle.delay_s(address, b"new") > 0.0]
    assert delayed == addresses[50:]
