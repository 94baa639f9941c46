"""Evidence of cells: independent of the order of points, and equal to slow code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.cell_sums import join_cell_sums
from companion.desk.survey.tiled.lattice import UNIT_M, Lattice
from companion.desk.survey.tiled.sort_points import Piece, sort_piece
from slz import Box
from slz.kernels.cells.cell_record import COUNT, HIGH, HIGH2, LOW, LOW2, MEAN
from slz.kernels.survey.point_binning import evidence_of, place
from tests.unit.companion.desk.survey.clouds import write

LATTICE = Lattice(1.0, 1.0, 1.0, 0.5)
ANY = (-(2**31), 2**31 - 1)


def scattered(n: int = 4000, seed: int = 0) -> np.ndarray:
    """Return points about a corner of four blocks, on whole millimetres and off the cells' edges."""
    rng = np.random.default_rng(seed)
    xy = np.round(rng.uniform(-6, 6, (n, 2)), 3) + 0.0005
    return np.column_stack([xy + np.array([128 * 4, -128 * 3]), np.round(rng.normal(20, 3, n), 3)])


def sorted_file(folder: Path, points: np.ndarray) -> Path:
    path = folder / "a.xyz"
    path.write_text("\n".join(" ".join(map(repr, p)) for p in points.tolist()))
    piece = Piece(0, path, "EPSG:32610", 0, len(points), folder / "0.sorted")
    assert sort_piece(piece, LATTICE, 1.25).broken is None
    return piece.sorted


def test_every_cell_holds_what_slow_code_finds(tmp_path: Path) -> None:
    points = scattered()
    inner = Box(-780, -756, 1012, 1036)
    sums = join_cell_sums([sorted_file(tmp_path, points)], inner, 3, Box(-9999, 9999, -9999, 9999), ANY, 0.5)
    assert sums.box == Box(-783, -753, 1009, 1039)
    got = evidence_of(sums.count, sums.total, sums.extreme, 0, UNIT_M, 0.02)[..., 0, :]
    cells = np.floor(points[:, :2] / 0.5).astype(int)
    n = 0
    for row in range(sums.box.row0, sums.box.row1):
        for col in range(sums.box.col0, sums.box.col1):
            z = np.sort(points[(cells[:, 1] == row) & (cells[:, 0] == col), 2])
            cell = got[row - sums.box.row0, col - sums.box.col0]
            assert cell[COUNT] == len(z)
            n += len(z)
            if len(z):
                assert cell[MEAN] == pytest.approx(z.mean(), abs=1e-4)
                assert cell[[LOW, HIGH]] == pytest.approx(z[[0, -1]], abs=1e-4)
            if len(z) > 1:
                assert cell[[LOW2, HIGH2]] == pytest.approx(z[[1, -2]], abs=1e-4)
    assert n == len(points)


def test_a_lone_return_beyond_a_gap_is_dropped_and_three_together_are_kept(tmp_path: Path) -> None:
    points = scattered()
    x, y = 510.25, -385.25
    lone, three = [x, y, 90.0], [[x + 4, y + 4 + 0.2 * k, 95.0] for k in range(3)]
    path = sorted_file(tmp_path, np.vstack([points, lone, three]))
    inner = Box(-790, -750, 1000, 1050)
    interval = (0, int(60 / UNIT_M))
    sums = join_cell_sums([path], inner, 0, Box(-9999, 9999, -9999, 9999), interval, 0.5)
    assert (sums.n_used, sums.n_outliers) == (len(points) + 3, 1)
    top = sums.extreme[..., 2].max()
    assert top == round(95 / UNIT_M)


def test_points_beyond_the_survey_s_box_count_nowhere(tmp_path: Path) -> None:
    path = sorted_file(tmp_path, scattered())
    inner = Box(-790, -750, 1000, 1050)
    sums = join_cell_sums([path], inner, 5, Box(-770, -760, 1020, 1030), ANY, 0.5)
    assert sums.box == Box(-770, -760, 1020, 1030)
    assert sums.n_used == sums.count.sum() > 0


def test_a_broken_piece_says_why_and_leaves_no_file(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", scattered(30_000))
    path.write_bytes(path.read_bytes()[:-20_000])
    outcome = sort_piece(Piece(7, path, None, 0, 30_000, tmp_path / "7.sorted"), LATTICE, 1.25)
    assert outcome.number == 7
    assert "truncated or corrupt" in str(outcome.broken)
    assert list(tmp_path.iterdir()) == [path]


def test_blocks_without_room_are_asked_for_anew() -> None:
    x = np.arange(4) * 128.0 + 1
    blocks, slots = np.zeros((2, 2), np.int64), np.full(8, -1, np.int64)
    cell, height, block = np.empty(4, np.uint16), np.empty(4, np.int32), np.empty(4, np.int32)
    mark = np.zeros(4, np.uint8)
    found = place(
        x, x, x, np.ones(4, bool), 2.0, 2.0, 1e4, 2e8, blocks, slots, 0,
        mark, cell, height, block, mark.copy(),
    )  # fmt: skip
    assert found == (-1, 2)
    assert blocks.tolist() == [[0, 0], [1, 1]]


def test_points_on_more_blocks_than_there_is_room_for_at_first_are_all_kept(tmp_path: Path) -> None:
    side = 70  # 4900 blocks of 128 m, each with two points
    east, north = (128.0 * axis.ravel() + 60.25 for axis in np.meshgrid(np.arange(side), np.arange(side)))
    one = np.column_stack([east, north, np.full(side**2, 20.0)])
    arrays, notes = array_file.read(sorted_file(tmp_path, np.vstack([one, one + np.array([1.0, 2.0, 3.0])])))
    assert len(arrays["blocks"]) == side**2
    assert arrays["blocks"].tolist() == [[row, col] for row in range(side) for col in range(side)]
    assert (np.diff(arrays["ends"], prepend=0) == 2).all()
    assert arrays["heights"].reshape(-1, 2).tolist() == [[200_000, 230_000]] * side**2
    assert notes == {"n_read": 2 * side**2, "dropped": {"not_finite": 0, "stray": 0}}


def test_a_packed_file_is_whole_or_absent(tmp_path: Path) -> None:
    arrays = {"a": np.arange(5, dtype=np.uint16), "b": np.zeros((0, 2)), "c": np.eye(3, dtype=np.float32)}
    array_file.write(tmp_path / "x", arrays, {"n": 1})
    found, notes = array_file.read(tmp_path / "x")
    assert notes == {"n": 1}
    assert {name: values.tolist() for name, values in found.items()} == {
        name: values.tolist() for name, values in arrays.items()
    }
    unfinished = array_file.atomic_file(tmp_path / "y")
    unfinished.path.write_bytes(b"half")
    unfinished.__exit__(RuntimeError)
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
