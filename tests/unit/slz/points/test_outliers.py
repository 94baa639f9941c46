"""Outlier removal: lone returns count only where returns recur."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.points.outliers import OFTEN, RECENT, IsolatedReturns

N_RETURNS = 100_000
# An object of 0.005 m2 sends back 0.005 x 100000 / (4 pi d2) of that many: two at 4.461 m.
FAR_M = 4.5
NOTHING = np.empty((0, 3))
SENSOR = np.array([10.0, 20.0, 30.0])


def below(down_m: float, aside_m: float = 0.0) -> NDArray[np.float64]:
    return SENSOR + np.array([[aside_m, 0.0, -down_m]])


def returning(lone: IsolatedReturns, at: NDArray[np.float64]) -> int:
    return len(lone.recurring(at, SENSOR, N_RETURNS))


def test_what_returns_in_the_fifth_window_counts_with_those_before() -> None:
    lone = IsolatedReturns()
    assert [returning(lone, below(FAR_M)) for _ in range(5)] == [0, 0, 0, 0, 5]
    assert OFTEN == 5


@pytest.mark.parametrize(("down_m", "counted"), [(4.44, 0), (4.48, 5)])
def test_near_the_sensor_an_object_would_send_back_two(down_m: float, counted: int) -> None:
    lone = IsolatedReturns()
    assert [returning(lone, below(down_m)) for _ in range(5)][-1] == counted


@pytest.mark.parametrize(("aside_m", "counted"), [(0.39, 5), (0.41, 0)])
def test_what_lies_elsewhere_is_another_thing(aside_m: float, counted: int) -> None:
    lone = IsolatedReturns()
    for _ in range(4):
        returning(lone, below(FAR_M))
    assert returning(lone, below(FAR_M, aside_m)) == counted


@pytest.mark.parametrize(("empty", "counted"), [(RECENT - OFTEN, 5), (RECENT - OFTEN + 1, 0)])
def test_only_the_last_twelve_windows_are_remembered(empty: int, counted: int) -> None:
    lone = IsolatedReturns()
    for _ in range(OFTEN - 1):
        returning(lone, below(FAR_M))
    for _ in range(empty):
        assert returning(lone, NOTHING) == 0
    assert returning(lone, below(FAR_M)) == counted


def test_of_several_only_the_one_that_returned_counts() -> None:
    lone = IsolatedReturns()
    for k in range(4):
        returning(lone, np.vstack([below(FAR_M), below(FAR_M, 2.0 + k)]))
    found = lone.recurring(np.vstack([below(FAR_M, 9.0), below(FAR_M)]), SENSOR, N_RETURNS)
    np.testing.assert_array_equal(found, np.repeat(below(FAR_M), 5, axis=0))
