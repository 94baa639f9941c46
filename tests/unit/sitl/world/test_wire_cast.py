"""Share of a beam that a thin wire covers, against the sum over the beam's cross-section."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.world.primitives import REFLECTANCE, Ground, Kind, Wire
from sitl.world.wire_cast import CUT, covered
from sitl.world.wires import THIN_M, Beam, WireEchoes, Wires
from sitl.world.world import World

F64 = NDArray[np.float64]
BEAM = Beam((0.006, 0.004), (0.003, 0.0012))
PER_FWHM = 1.0 / math.sqrt(8.0 * math.log(2.0))


def summed(h: float, s0: float, s1: float, radius: float, turn: float, sigma: tuple[float, float]) -> float:
    """Return the share of a Gaussian on a fine grid that is within a strip between two ends."""
    axis = np.linspace(-5.0, 5.0, 2001)
    x, y = np.meshgrid(axis * sigma[0], axis * sigma[1])
    weight = np.exp(-0.5 * (axis[:, np.newaxis] ** 2 + axis**2))
    nx, ny = math.cos(turn), math.sin(turn)
    across, along = nx * x + ny * y, ny * x - nx * y
    inside = (np.abs(across - h) <= radius) & (along >= s0) & (along <= s1)
    return float((weight * inside).sum() / weight.sum())


def echoes(
    wires: list[Wire], aside_m: float = 0.0, end_m: float = math.nan, pitch: float = 0.0
) -> WireEchoes:
    """Return the echoes of a beam from (0, aside_m, 20) straight down, of a sensor whose axis is north."""
    direction = np.array([[math.sin(pitch), 0.0, -math.cos(pitch)]])
    up = np.array([[0.0, 1.0, 0.0]])
    return Wires(wires).echoes(
        np.array([[0.0, aside_m, 20.0]]), direction, up, np.array([end_m]), 100.0, BEAM
    )


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.2, math.pi / 2])
@pytest.mark.parametrize("h", [0.0, 0.02, -0.05])
def test_the_share_of_a_strip_is_that_of_the_sum_over_the_beam(turn: float, h: float) -> None:
    sigma = (0.04, 0.015)
    for s0, s1 in ((-9.0, 9.0), (-9.0, 0.01), (0.0, 0.03)):
        share = covered(h, s0, s1, 0.002, math.cos(turn), math.sin(turn), *sigma)
        cut = abs(h) - 0.002 > CUT * math.hypot(sigma[0] * math.cos(turn), sigma[1] * math.sin(turn))
        assert share == pytest.approx(0.0 if cut else summed(h, s0, s1, 0.002, turn, sigma), abs=2e-3)


def test_a_wire_through_the_axis_covers_its_share_of_the_footprint() -> None:
    """A wire to the east lies across the level axis: the width upward, towards north, counts."""
    found = echoes([Wire((-5.0, 0.0, 8.0), (5.0, 0.0, 8.0), 0.005)])
    sigma = PER_FWHM * BEAM.width_m(12.0)[1]
    share = math.erf(0.005 / sigma / math.sqrt(2.0))
    assert found.share[0] == pytest.approx([share, 0.0, 0.0], abs=1e-9)
    assert found.range_m[0, 0] == pytest.approx(12.0 - 0.005)
    assert found.bright[0, 0] == pytest.approx(share * REFLECTANCE[Kind.METAL] * math.pi / 4)
    assert (found.index[0, 0], found.through[0]) == (0, pytest.approx(1.0 - share))


def test_the_level_width_counts_for_a_wire_to_the_north() -> None:
    found = echoes([Wire((0.0, -5.0, 8.0), (0.0, 5.0, 8.0), 0.005)])
    sigma = PER_FWHM * BEAM.width_m(12.0)[0]
    assert found.share[0, 0] == pytest.approx(math.erf(0.005 / sigma / math.sqrt(2.0)), abs=1e-9)


def test_an_oblique_wire_is_darker_by_the_sine() -> None:
    steep = echoes([Wire((0.0, -5.0, 3.0), (0.0, 5.0, 13.0), 0.005)])
    level = echoes([Wire((0.0, -5.0, 8.0), (0.0, 5.0, 8.0), 0.005)])
    assert steep.bright[0, 0] / level.bright[0, 0] == pytest.approx(math.sqrt(0.5), rel=1e-6)


@pytest.mark.parametrize("aside_m", [-0.02, -0.003, 0.0, 0.004, 0.02])
def test_pieces_of_a_wire_add_up_to_the_whole(aside_m: float) -> None:
    ends = [(-5.0, 0.0, 8.0), (-1.0, 0.0, 8.0), (0.001, 0.0, 8.0), (0.01, 0.0, 8.0), (4.1, 0.0, 8.0)]
    pieces = [Wire(a, b, 0.005, name=f"{a}") for a, b in pairwise(ends)]
    whole, parts = echoes([Wire(ends[0], ends[-1], 0.005)], aside_m), echoes(pieces, aside_m)
    np.testing.assert_allclose(parts.share, whole.share, atol=1e-9)
    np.testing.assert_allclose(parts.range_m[0, 0], whole.range_m[0, 0], atol=1e-9)


def test_pieces_listed_in_several_cells_count_once_on_a_slanting_beam() -> None:
    wire = [Wire((-30.0, 0.0, 8.0), (30.0, 0.0, 8.0), 0.005)]
    found = echoes(wire, pitch=0.9)
    sigma = PER_FWHM * BEAM.width_m(12.0 / math.cos(0.9))[1]
    assert found.share[0] == pytest.approx([math.erf(0.005 / sigma / math.sqrt(2.0)), 0.0, 0.0], abs=1e-9)


def test_beside_the_footprint_and_behind_the_ground_there_is_no_echo() -> None:
    wire = [Wire((-5.0, 0.0, 8.0), (5.0, 0.0, 8.0), 0.005)]
    edge = CUT * PER_FWHM * BEAM.width_m(12.0)[1] + 0.005
    assert echoes(wire, 0.99 * edge).share[0, 0] > 0.0
    assert echoes(wire, 1.01 * edge).share[0, 0] == 0.0
    assert echoes(wire, end_m=11.9).share[0, 0] == 0.0
    assert echoes(wire, end_m=12.1).share[0, 0] > 0.0


def test_the_nearer_of_two_wires_shades_the_other() -> None:
    near, far = (Wire((-5.0, 0.0, z), (5.0, 0.0, z), 0.005) for z in (15.0, 5.0))
    both, alone = echoes([far, near]), echoes([far])
    k, n = (int(np.flatnonzero(both.index[0] == i)[0]) for i in (0, 1))
    left = 1.0 - both.share[0, n]
    assert both.bright[0, k] == pytest.approx(left * alone.bright[0, 0])


def test_beams_pass_thin_wires_that_other_rays_hit() -> None:
    ground = Ground(-10.0, -10.0, 2.0, np.zeros((11, 11)), np.full((10, 10), Kind.GRASS, np.uint8))
    for radius, beam_m in ((THIN_M, 20.0), (0.02, 10.0 - 0.02)):
        world = World(ground, [Wire((-5.0, 0.0, 10.0), (5.0, 0.0, 10.0), radius)])
        ray = np.array([[0.0, 0.0, 20.0]]), np.array([[0.0, 0.0, -1.0]])
        range_m, _, _ = world.trace(*ray, 100.0)
        beam = world.cross(*ray, 100.0, np.empty((1, 0)), thin_wires=False)
        assert range_m[0] == pytest.approx(10.0 - radius)
        assert beam.range_m[0] == pytest.approx(beam_m)
        assert bool(world.wires) is (radius <= THIN_M)
