"""Snapshots of a map: unaffected by later changes, though they share memory."""

from __future__ import annotations

import numpy as np

from slz.grid import Box
from slz.paper.paper_terrain import SIDE, BlockCopies, heights_at, joined

ALL = np.array(True)  # of the blocks


def test_a_copy_is_of_the_moment_it_was_made() -> None:
    rng = np.random.default_rng(0)
    values = rng.random((3 * SIDE + 10, 4 * SIDE)).astype(np.float32)
    by_blocks = np.ascontiguousarray(values.reshape(-1, 4, SIDE).transpose(1, 0, 2))
    copies, taken = BlockCopies(by_blocks), []
    for _ in range(60):
        row0, col0 = int(rng.integers(0, 190)), int(rng.integers(0, 240))
        box = Box(row0, int(rng.integers(row0 + 1, 203)), col0, int(rng.integers(col0 + 1, 257)))
        if rng.random() < 0.5:
            values[box.slices] += 1
            by_blocks[:] = values.reshape(-1, 4, SIDE).transpose(1, 0, 2)
            copies.change(box)
        else:
            wide = slice(box.col0 // SIDE * SIDE, -(-box.col1 // SIDE) * SIDE)
            taken.append((copies.of(box, ALL), box, values[box.row0 : box.row1, wide].copy()))
    assert len(taken) > 20
    for blocks, box, then in taken:
        np.testing.assert_array_equal(joined(blocks, box), then)
        shape = box.shape
        cells = np.column_stack([rng.integers(0, n, 50) for n in shape]).astype(np.int32)
        own = then[:, box.col0 % SIDE :][cells[:, 0], cells[:, 1]]
        corner = np.array([box.row0, box.col0], np.int32)
        np.testing.assert_array_equal(heights_at(blocks, box, cells + corner), own)


def test_what_did_not_change_is_shared() -> None:
    copies = BlockCopies(np.zeros((2, 2 * SIDE, SIDE), np.float32))
    everything = Box(0, 2 * SIDE, 0, 2 * SIDE)
    before = copies.of(everything, ALL)
    copies.change(Box(0, 1, SIDE, SIDE + 1))
    after = copies.of(everything, ALL)
    assert [a is b for a, b in zip(before.ravel(), after.ravel(), strict=True)] == [True, False, True, True]


def test_only_what_is_wanted_is_copied() -> None:
    values = np.arange(2 * 2 * SIDE * SIDE, dtype=np.float32).reshape(2, 2 * SIDE, SIDE)
    copies, everything = BlockCopies(values), Box(3, 2 * SIDE, 0, 2 * SIDE)
    wanted = np.array([[True, False], [False, True]])
    blocks = copies.of(everything, wanted)
    assert [block is not None for block in blocks.ravel()] == wanted.ravel().tolist()
    found = joined(blocks, everything)
    np.testing.assert_array_equal(found[: SIDE - 3, :SIDE], values[0, 3:SIDE])
    np.testing.assert_array_equal(found[SIDE - 3 :, SIDE:], values[1, SIDE:])
    assert np.isnan(found[: SIDE - 3, SIDE:]).all()
    assert np.isnan(found[SIDE - 3 :, :SIDE]).all()
    values += 1
    copies.change(everything)
    assert copies.of(everything, ~wanted)[0, 0] is None
    np.testing.assert_array_equal(copies.of(everything, wanted)[0, 0], values[0, :SIDE])
