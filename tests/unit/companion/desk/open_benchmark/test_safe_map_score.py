"""Counts of a safe map against a truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from companion.desk.open_benchmark.landing_task import SafeMap
from companion.desk.open_benchmark.safe_map_score import SafeMapCounts, score
from tests.unit.companion.desk.open_benchmark.flights_over import case_of

STATES = arrays.arrays(np.uint8, (6, 8), elements=st.sampled_from([0, 1, 255]))
PROBABILITIES = arrays.arrays(
    np.float32, (6, 8), elements=st.one_of(st.floats(0, 1, width=32), st.just(float("nan")))
)


@settings(max_examples=30)
@given(STATES, STATES, PROBABILITIES)
def test_figures_are_those_of_counting_cell_by_cell(
    safe: np.ndarray, state: np.ndarray, probability: np.ndarray
) -> None:
    truth = case_of(safe).truth
    figures = score(SafeMap(state, probability), truth).figures()
    cells = [tuple(cell) for cell in np.argwhere(safe != 255)]
    unsafe = [cell for cell in cells if safe[cell] == 0]
    missed = [cell for cell in unsafe if state[cell] == 1]
    found = [cell for cell in cells if safe[cell] == 1 and state[cell] == 1]
    assert figures["judged"] == len(cells)
    assert figures["unsafe_called_safe"] == (len(missed) / len(unsafe) if unsafe else None)
    assert figures["safe_is_unsafe"] == (len(missed) / len(missed + found) if missed + found else None)
    assert figures["safe_found"] == (
        len(found) / (len(cells) - len(unsafe)) if len(cells) > len(unsafe) else None
    )
    assert figures["unknown"] == (sum(state[cell] == 255 for cell in cells) / len(cells) if cells else None)
    for name, of in figures["by_kind"].items():
        mine = [cell for cell in unsafe if truth.kinds[truth.kind[cell]] == name]
        assert of["unsafe_called_safe"] == sum(state[cell] == 1 for cell in mine) / len(mine)
    told = [cell for cell in cells if np.isfinite(probability[cell])]
    errors = [(float(probability[cell]) - safe[cell]) ** 2 for cell in told]
    assert figures["brier"] == (pytest.approx(np.mean(errors)) if told else None)
    assert sum(one["cells"] for one in figures["reliability"]) == len(told)
    for one in figures["reliability"]:
        assert one["from"] - 1e-9 <= one["mean"] <= one["to"] + 1e-9


@settings(max_examples=20)
@given(STATES, STATES, STATES, STATES, PROBABILITIES)
def test_added_counts_are_those_of_both_maps_as_one(
    safe: np.ndarray, other: np.ndarray, state: np.ndarray, state2: np.ndarray, told: np.ndarray
) -> None:
    total = SafeMapCounts()
    total.add(score(SafeMap(state, told), case_of(safe).truth))
    total.add(score(SafeMap(state2, told), case_of(other).truth))
    both = score(
        SafeMap(np.vstack([state, state2]), np.vstack([told, told])), case_of(np.vstack([safe, other])).truth
    )
    one, two = total.figures(), both.figures()
    assert one.pop("brier") == pytest.approx(two.pop("brier"))
    bins = zip(one.pop("reliability"), two.pop("reliability"), strict=True)
    assert all(a == pytest.approx(b) for a, b in bins)
    assert one == two


def test_unknown_is_never_called_safe() -> None:
    truth = case_of(np.array([[0, 0], [1, 1]], np.uint8)).truth
    figures = score(SafeMap(np.full((2, 2), 255, np.uint8)), truth).figures()
    assert (figures["unsafe_called_safe"], figures["safe_found"], figures["unknown"]) == (0.0, 0.0, 1.0)


def curve(answer: SafeMap, safe: np.ndarray) -> list[float | None]:
    return [
        at["unsafe_called_safe"] for at in score(answer, case_of(safe).truth).figures()["operating_curve"]
    ]


SURE = np.array([[0.95, 0.9, 0.85, 0.7, 0.55, 0.5, 0.3, 0.2, 0.15, 0.1]], np.float32)  # ten safe cells
DOUBT = np.array([[0.92, 0.52, 0.25, np.nan]], np.float32)  # four unsafe ones


def test_the_operating_curve_moves_the_threshold_to_a_share_of_safe_cells() -> None:
    safe = np.array([[1] * 10 + [0] * 4], np.uint8)
    told = np.hstack([SURE, DOUBT])
    state = np.zeros(safe.shape, np.uint8)  # what the method calls safe does not count here
    assert curve(SafeMap(state, told), safe) == [0.25, 0.5, 0.5, 0.75, 0.75]
    assert curve(SafeMap(state, limit_share=1 / told - 1), safe) == [0.25, 0.5, 0.5, 0.75, 0.75]
    assert curve(SafeMap(state), safe) == []


def test_the_operating_curve_ends_where_the_method_knows_no_more_safe_cells() -> None:
    safe = np.array([[1] * 10 + [0] * 4], np.uint8)
    told = np.hstack([SURE, DOUBT])
    told[0, 7:10] = np.nan
    state = np.ones(safe.shape, np.uint8)
    state[0, 6] = 255  # unknown, whatever its probability
    assert curve(SafeMap(state, told), safe) == [0.25, 0.5, None, None, None]


def test_cells_that_are_told_alike_count_in_part() -> None:
    safe = np.array([[1] * 10 + [0] * 4], np.uint8)
    told = np.full(safe.shape, 0.7, np.float32)
    assert curve(SafeMap(safe, told), safe) == pytest.approx([0.5, 0.6, 0.7, 0.8, 0.9])
