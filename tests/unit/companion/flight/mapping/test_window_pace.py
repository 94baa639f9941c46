"""Windows longer on a slow computer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import params
from companion.flight.mapping.window_pace import LEAST, SHARE, WindowPace


def paced(
    fixed_s: float,
    per_s: float,
    *own: str,
    longest_s: float = 2.0,
    n: int = 200,
    alone: Callable[[float], float] = lambda _: 0.0,
) -> WindowPace:
    """The pace after windows that take so long to compute, whatever they hold, and for each second of it."""
    pace = WindowPace(params.load("quadcopter", list(own)))
    for _ in range(n):
        pace.follow(fixed_s + per_s * pace.window_s, longest_s, alone(pace.window_s))
    return pace


@pytest.mark.parametrize("window_s", [0.1, 1.0])
def test_a_computer_that_is_fast_enough_makes_windows_as_short_as_wanted(window_s: float) -> None:
    pace = paced(0.002, 0.05, f"window_s={window_s}")
    assert pace.window_s == pytest.approx(LEAST * window_s)


@pytest.mark.parametrize(("dense_s", "expected_s"), [(0.01, 0.1), (0.4, 0.4), (7.0, 1.0)])
def test_windows_are_so_long_that_half_of_the_returns_have_others_near(
    dense_s: float, expected_s: float
) -> None:
    """Up to the parameter: a sensor of few returns has none near even then."""
    pace = paced(0.002, 0.05, alone=lambda span_s: 1 / (1 + span_s / dense_s))
    assert pace.window_s == pytest.approx(expected_s, rel=0.02)


@pytest.mark.parametrize(("fixed_s", "per_s"), [(0.6, 0.0), (0.5, 0.1), (0.3, 0.2)])
def test_a_slower_one_makes_them_so_long_that_it_computes_for_no_more_than_its_share(
    fixed_s: float, per_s: float
) -> None:
    assert paced(fixed_s, per_s).window_s == pytest.approx(fixed_s / (SHARE - per_s), rel=0.01)


def test_no_window_is_longer_than_suits_the_flight() -> None:
    assert paced(0.5, 0.3, longest_s=0.5).window_s == 0.5


@pytest.mark.parametrize("fixed", ["adaptive=off", "mode=source"])
def test_fixed_windows_stay_as_they_are(fixed: str) -> None:
    assert paced(0.9, 0.3, fixed, "window_s=0.8").window_s == 0.8
