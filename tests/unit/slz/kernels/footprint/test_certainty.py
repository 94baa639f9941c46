"""Certainty as a probability: it falls towards each limit and with every gap; unknown ground has none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import SAFE, UNKNOWN
from slz.kernels.footprint.certainty import ALONE_MOST, FEW, HIDDEN, STRUCK, certainty, hazard_quarters
from tests.unit.slz.test_pipeline import block, ground, maps, pipeline, run

PARAMETERS = params.load("quadcopter")
QUARTERS = hazard_quarters(PARAMETERS.cell_m, PARAMETERS.hazard_size_m)


def of(
    slope_deg: float = 2.0,
    sigma_deg: float = 0.2,
    relief_m: float = 0.1,
    inner_m: float | None = None,
    noise_m: float = 0.03,
    share: float = 1.0,
) -> float:
    inner_m = relief_m if inner_m is None else inner_m
    values = slope_deg, sigma_deg, relief_m, inner_m, noise_m, share
    return certainty(*values, PARAMETERS.safe_slope_deg, PARAMETERS.relief_m, QUARTERS)


def falling(values: list[float]) -> bool:
    return bool((np.diff(values) < 0).all())


def test_gentle_even_ground_seen_all_over_is_as_certain_as_the_map_is() -> None:
    assert of() == pytest.approx(STRUCK, abs=1e-3)


def test_it_falls_towards_and_beyond_each_limit() -> None:
    assert falling([of(slope_deg=slope) for slope in (9.5, 9.7, 9.9, 10.1, 10.3)])
    assert falling([of(relief_m=relief) for relief in (0.28, 0.30, 0.32, 0.34, 0.36)])
    assert of(slope_deg=11.0) < 0.001
    assert of(relief_m=0.6) < 0.001


def test_at_the_slope_s_limit_it_is_about_even_and_less_sure_with_a_larger_error() -> None:
    assert of(slope_deg=10.0) == pytest.approx(0.5, abs=0.01)
    assert of(slope_deg=9.0, sigma_deg=1.0) < of(slope_deg=9.0, sigma_deg=0.3)
    assert of(slope_deg=11.0, sigma_deg=1.0) > of(slope_deg=11.0, sigma_deg=0.3)


def test_what_stands_out_alone_may_be_clutter_less_so_in_a_few_cells_and_never_in_many() -> None:
    assert of(relief_m=1.0, inner_m=0.1) == pytest.approx(ALONE_MOST, abs=0.01)
    assert of(relief_m=1.0, inner_m=0.9) == pytest.approx(FEW, abs=0.01)
    assert of(relief_m=1.0, inner_m=1.0) < 0.001
    assert falling([of(relief_m=1.0, inner_m=0.1, share=share) for share in (1.0, 0.5, 0.3, 0.1)])


def test_on_uneven_ground_gaps_hide_more() -> None:
    assert falling([of(relief_m=relief, noise_m=0.01, share=0.5) for relief in (0.1, 0.15, 0.2, 0.24)])


def test_gaps_cost_certainty() -> None:
    assert falling([of(share=share) for share in (1.0, 0.7, 0.4, 0.1)])


@pytest.mark.parametrize("per_m2", [5.0, 20.0, 50.0])
@pytest.mark.parametrize("cell_m", [0.1, 0.15, 0.2])
def test_gaps_hide_a_hazard_of_0_3_m_as_often_as_it_gets_no_return(per_m2: float, cell_m: float) -> None:
    """Returns at random: the share of empty cells is exp(-density x cell area)."""
    share = 1 - np.exp(-per_m2 * cell_m**2)
    told = certainty(2.0, 0.2, 0.1, 0.1, 0.03, share, 10.0, 0.3, hazard_quarters(cell_m, 0.3))
    assert STRUCK - told == pytest.approx(HIDDEN * np.exp(-per_m2 * 0.09), rel=0.2)


@pytest.mark.parametrize("missing", range(6))
def test_nothing_is_certain_of_what_is_not_known(missing: int) -> None:
    values = [2.0, 0.2, 0.1, 0.1, 0.03, 1.0]
    values[missing] = np.nan
    assert certainty(*values, PARAMETERS.safe_slope_deg, PARAMETERS.relief_m, QUARTERS) == 0


def at(array: NDArray[np.float32], pipe: object, east: float, north: float) -> float:
    m = maps(pipe)  # type: ignore[arg-type]
    row, col = m.grid.index(east, north)
    return float(array[row - m.box.row0, col - m.box.col0])


def test_the_map_of_certainty_agrees_with_the_states() -> None:
    pipe = pipeline()
    cloud = np.vstack([ground(density=60), block(3, 3, 1.5, 1.0)])
    run(pipe, cloud[np.hypot(cloud[:, 0] + 5, cloud[:, 1] + 5) > 2])
    m = maps(pipe)
    assert (m.certainty[m.state == UNKNOWN] == 0).all()
    assert m.certainty[m.state == SAFE].min() > 0.8
    assert at(m.certainty, pipe, 3.0, 3.0) < 0.01
    assert at(m.certainty, pipe, -5.0, -5.0) == 0.0
    assert ((m.certainty >= 0) & (m.certainty <= 1)).all()


def test_the_certainty_of_a_zone_is_the_mean_of_what_lies_inside_its_contour() -> None:
    pipe = pipeline()
    report = run(pipe, np.vstack([ground(density=60), block(3, 3, 1.5, 1.0)]))
    (zone,) = report.zones
    assert zone.best.certainty > 0.99
    inside = zone.n_safe + zone.n_unsafe + zone.n_uncertain
    assert zone.n_unsafe > 0
    assert zone.certainty == pytest.approx(zone.n_safe / inside, abs=0.05)
