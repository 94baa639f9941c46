"""Windows as short as the computer allows."""

from __future__ import annotations

import pytest

import params
from companion.flight.mapping.window_pace import SHARE, WindowPace


def paced(fixed_s: float, per_s: float, *own: str, longest_s: float = 1.0, n: int = 200) -> WindowPace:
    """The pace after windows that take so long to compute, whatever they hold, and for each second of it."""
    pace = WindowPace(params.load("quadcopter", list(own)))
    for _ in range(n):
        pace.follow(fixed_s + per_s * pace.window_s, longest_s)
    return pace


def test_a_computer_that_is_fast_enough_makes_ten_windows_a_second() -> None:
    assert paced(0.02, 0.05).window_s == pytest.approx(0.1)


@pytest.mark.parametrize(("fixed_s", "per_s"), [(0.06, 0.0), (0.1, 0.1), (0.05, 0.2)])
def test_a_slower_one_makes_them_so_long_that_it_computes_for_no_more_than_its_share(
    fixed_s: float, per_s: float
) -> None:
    assert paced(fixed_s, per_s).window_s == pytest.approx(fixed_s / (SHARE - per_s), rel=0.01)


def test_no_window_is_longer_than_suits_the_flight() -> None:
    assert paced(0.5, 0.3, longest_s=0.5).window_s == 0.5


@pytest.mark.parametrize("fixed", ["adaptive=off", "mode=source"])
def test_fixed_windows_stay_as_they_are(fixed: str) -> None:
    assert paced(0.9, 0.3, fixed, "window_s=0.8").window_s == 0.8


def test_the_shortest_window_is_a_tenth_of_the_parameter() -> None:
    assert paced(0.0, 0.0, "window_s=2").window_s == pytest.approx(0.2)
