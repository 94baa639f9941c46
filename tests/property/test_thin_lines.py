"""Thin lines near the ground: few returns of one make all of it unsafe; posts in a row and dust make none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.points.collinear_returns import (
    BEYOND,
    LINE_FIELDS,
    PLACES,
    SEEN_RAYS,
    START,
    STOP,
    follow_lines,
    points_along,
)
from slz.kernels.points.nearest_others import (
    BAND,
    HIGH,
    HIGH_M,
    ISOLATED_FIELDS,
    LINE,
    LOW,
    OVER,
    RAYS,
    TRIED,
    UP,
    UPRIGHT,
)
from slz.terrain.terrain_maps import SAFE, UNSAFE
from tests.unit.slz.terrain.test_thin_objects import cut, dust, fly, ground, state_at

Floats = NDArray[np.float64]
HALF_M = 9.0
NO_LINES = np.empty((0, LINE_FIELDS))


def between(start: tuple[float, ...], stop: tuple[float, ...], n: int, rng: np.random.Generator) -> Floats:
    """Return returns anywhere along a thin line, missed by 1 cm."""
    share = np.sort(rng.uniform(0, 1, n))[:, np.newaxis]
    return np.array(start) * (1 - share) + np.array(stop) * share + rng.normal(0, 0.01, (n, 3))


def records_of(points: Floats, rays_m2: float = 100.0) -> Floats:
    records = np.zeros((len(points), ISOLATED_FIELDS))
    records[:, : UP + 1], records[:, OVER], records[:, UPRIGHT:] = points, points[:, UP], np.inf
    records[:, BAND] = np.where(points[:, UP] > HIGH_M, HIGH, LOW)
    records[:, RAYS] = rays_m2
    return records


def clutter(n: int, rng: np.random.Generator) -> Floats:
    return np.column_stack([rng.uniform(-HALF_M, HALF_M, (n, 2)), rng.uniform(0.3, 2.4, n)])


LINES = {
    "clothes line": ((-5.0, -2.0, 1.8), (5.0, 1.0, 1.8)),
    "guy wire": ((4.0, 3.0, 0.3), (0.0, 0.0, 5.0)),
    "rope": ((-3.0, 4.0, 0.5), (1.0, 4.0, 1.1)),
}


@pytest.mark.parametrize("name", LINES)
def test_five_returns_of_a_line_among_dust_make_it_unsafe_between_them_too(name: str) -> None:
    start, stop = LINES[name]
    line = between(start, stop, 5, np.random.default_rng(4))
    middle = (line[1:] + line[:-1]) / 2
    pipe = fly(cut(np.vstack([ground(100.0), dust(40), line]), 5))
    assert {state_at(pipe, east, north) for east, north, _ in middle.tolist()} == {UNSAFE}


def test_the_ground_between_posts_of_many_returns_is_safe() -> None:
    """Five posts in a row, 3 m apart: no line joins them."""
    rng = np.random.default_rng(5)
    places = [(east, 2.0) for east in (-6.0, -3.0, 0.0, 3.0, 6.0)]
    posts = [np.column_stack([rng.normal(place, 0.03, (6, 2)), rng.uniform(0.2, 0.9, 6)]) for place in places]
    pipe = fly(cut(np.vstack([ground(100.0), *posts]), 5))
    assert [state_at(pipe, east + 1.5, 2.0) for east, _ in places[:-1]] == [SAFE] * 4
    assert [state_at(pipe, east, 2.0) for east, _ in places] == [UNSAFE] * 5


def test_a_row_of_things_of_many_returns_is_no_line() -> None:
    """Every return of a line would be at one of five knobs, 3 m apart."""
    rng = np.random.default_rng(10)
    knobs = [np.array([east, 2.0, 1.0]) + rng.normal(0, 0.03, (5, 3)) for east in (-6.0, -3.0, 0.0, 3.0, 6.0)]
    assert not len(follow_lines(records_of(np.vstack(knobs)), NO_LINES))


def test_dust_makes_about_one_line_of_ten_thousand_specks() -> None:
    rng = np.random.default_rng(6)
    found = [follow_lines(records_of(clutter(100, rng)), NO_LINES) for _ in range(100)]
    assert sum(map(len, found)) <= 3


def test_order_shift_and_heading_do_not_matter() -> None:
    rng = np.random.default_rng(7)
    points = np.vstack([clutter(60, rng), between(*LINES["clothes line"], 6, rng)])
    (line,) = follow_lines(records_of(points), NO_LINES)
    c, n = np.cos(1.1), np.sin(1.1)
    turn, shift = np.array([[c, n, 0], [-n, c, 0], [0, 0, 1]]), np.array([300.0, -80.0, 0.0])
    (other,) = follow_lines(records_of(points[rng.permutation(len(points))] @ turn + shift), NO_LINES)
    ends, others = (
        np.array(sorted(map(tuple, each.round(6))))
        for each in (
            np.stack([line[START : START + 3], line[STOP : STOP + 3]]) @ turn + shift,
            np.stack([other[START : START + 3], other[STOP : STOP + 3]]),
        )
    )
    np.testing.assert_allclose(ends, others, atol=1e-6)
    assert line[PLACES] == other[PLACES]


def test_new_returns_lengthen_a_line_and_many_rays_without_one_end_it() -> None:
    rng = np.random.default_rng(8)
    points = between((-3.0, 0.0, 1.5), (1.0, 0.0, 1.5), 6, rng)
    records = records_of(points)
    lines = follow_lines(records, NO_LINES)
    assert len(lines) == 1
    assert records[:, LINE].all()
    assert records[:, TRIED].all()
    grown = np.vstack([records, records_of(np.array([[1.3, 0.0, 1.5]]))])
    lines = follow_lines(grown, lines)
    assert max(lines[0, START], lines[0, STOP]) == pytest.approx(1.3)
    grown[:, RAYS] = lines[0, SEEN_RAYS] * 1.5
    assert len(follow_lines(grown, lines)) == 1
    grown[:, RAYS] *= 2.0
    assert not len(follow_lines(grown, lines))
    assert not grown[:, LINE].any()


def test_places_along_a_line_leave_no_cell_out() -> None:
    (line,) = follow_lines(
        records_of(between((0.0, 0.0, 1.0), (4.0, 0.0, 1.0), 5, np.random.default_rng(9))), NO_LINES
    )
    along = points_along(line[np.newaxis], 0.1)
    assert np.diff(np.sort(along[:, 0])).max() <= 0.1 + 1e-9
    assert along[:, 0].max() - along[:, 0].min() == pytest.approx(
        abs(line[STOP] - line[START]) + 2 * line[BEYOND], rel=1e-3
    )
