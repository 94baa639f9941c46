"""Spans of wire against the catenary."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from sitl.scenes.lines.catenary import constant_m, heights_m, span


@pytest.mark.parametrize(
    ("length_m", "rise_m", "sag_m"),
    [(30.0, 0.0, 0.5), (300.0, 12.0, 9.0), (180.0, -25.0, 6.0), (22.0, -4.0, 0.5)],
)
def test_a_span_departs_from_the_catenary_by_less_than_a_millimetre(
    length_m: float, rise_m: float, sag_m: float
) -> None:
    start, end = (3.0, -2.0, 20.0), (3.0 + 0.6 * length_m, -2.0 + 0.8 * length_m, 20.0 + rise_m)
    wires = span("span", start, end, sag_m, 0.01)
    assert wires[0].start_enu_m == pytest.approx(start, abs=1e-9)
    assert wires[-1].end_enu_m == pytest.approx(end, abs=1e-6)
    a = constant_m(length_m, rise_m, sag_m)
    # The catenary through both ends, from its definition alone: z'' = cosh(u) / a with u = asinh(z').
    nodes = np.array([w.start_enu_m for w in wires] + [wires[-1].end_enu_m])
    along = np.linspace(0.0, length_m, 20_001)
    z = np.interp(along, np.hypot(nodes[:, 0] - 3.0, nodes[:, 1] + 2.0), nodes[:, 2])
    middle = length_m / 2
    lowest = middle - a * math.asinh(rise_m / (2 * a * math.sinh(middle / a)))
    exact = 20.0 + a * (np.cosh((along - lowest) / a) - np.cosh(lowest / a))
    assert exact[-1] == pytest.approx(20.0 + rise_m, abs=1e-5)
    assert 20.0 + rise_m / 2 - exact[10_000] == pytest.approx(sag_m, abs=1e-5)
    assert np.abs(z - exact).max() < 1e-3
    assert all(b.start_enu_m == a.end_enu_m for a, b in pairwise(wires))


def test_a_tight_span_is_nearly_a_parabola_with_its_sag_at_the_middle() -> None:
    along = np.linspace(0.0, 100.0, 11)
    heights = heights_m(along, 100.0, 0.0, 1.0)
    np.testing.assert_allclose(heights, -4.0 * (along / 100.0) * (1.0 - along / 100.0), atol=2e-3)


def test_no_sag_is_one_straight_piece() -> None:
    (wire,) = span("stay", (0.0, 0.0, 0.0), (5.0, 0.0, 9.0), 0.0, 0.005)
    assert (wire.start_enu_m, wire.end_enu_m) == ((0.0, 0.0, 0.0), (5.0, 0.0, 9.0))
