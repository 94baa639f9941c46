"""Resolution pyramid: evidence of a cell from that of the four cells of half its width."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array4D, Array5D, Float32
from slz.kernels.array_memory import put
from slz.kernels.cells.accumulate import copy_evidence
from slz.kernels.cells.cell_record import COUNT, FIELDS, HIGH, HIGH2, LOW, LOW2, MEAN, NOISE, TILE_BITS, TIME
from slz.kernels.jit import kernel, kernel_part


@kernel_part
def downsample(evidence: Array4D[np.float32], now_s: Float32, max_age_s: Float32) -> Array4D[np.float32]:
    """Merge 2 x 2 cells, (2 r, 2 c) the first of cell (r, c), and both their epochs into one epoch.

    The statistics are those of all returns together. Cells not seen for `max_age_s` count as unseen; the time
    of the merged cell is that of its cell not seen for longest.
    """
    rows, cols = evidence.shape[0] // 2, evidence.shape[1] // 2
    out = np.zeros((rows, cols, 2, FIELDS), np.float32)
    for r in range(rows):
        for c in range(cols):
            joint = out[r, c, 0]
            for i in range(2 * r, 2 * r + 2):
                for j in range(2 * c, 2 * c + 2):
                    seen_s = evidence[i, j, 1, TIME]
                    if evidence[i, j, 0, COUNT] == 0 or now_s - seen_s > max_age_s:
                        continue
                    if joint[COUNT] == 0 or seen_s < out[r, c, 1, TIME]:
                        out[r, c, 1, TIME] = seen_s
                    for epoch in range(2):
                        part = evidence[i, j, epoch]
                        n = part[COUNT]
                        if n == 0:
                            continue
                        if joint[COUNT] == 0:
                            for f in range(FIELDS):
                                joint[f] = part[f]
                            continue
                        total = joint[COUNT] + n
                        joint[MEAN] += (part[MEAN] - joint[MEAN]) * n / total
                        joint[NOISE] += (part[NOISE] - joint[NOISE]) * n / total
                        low2 = part[LOW2] if n > 1 else np.float32(np.inf)
                        own2 = joint[LOW2] if joint[COUNT] > 1 else np.float32(np.inf)
                        joint[LOW2] = min(max(joint[LOW], part[LOW]), low2, own2)
                        joint[LOW] = min(joint[LOW], part[LOW])
                        high2 = part[HIGH2] if n > 1 else np.float32(-np.inf)
                        own2 = joint[HIGH2] if joint[COUNT] > 1 else np.float32(-np.inf)
                        joint[HIGH2] = max(min(joint[HIGH], part[HIGH]), high2, own2)
                        joint[HIGH] = max(joint[HIGH], part[HIGH])
                        joint[TIME] = min(joint[TIME], part[TIME])
                        joint[COUNT] = total
    return out


@kernel
def coarse_evidence(
    pool: Array5D[np.float32],
    table: Array2D[np.int32],
    box: tuple[int, int, int, int],
    level: int,
    now_s: Float32,
    max_age_s: Float32,
) -> Array4D[np.float32]:
    """Return the evidence of cells of a level, merged from the tiles row by row.

    Parameters
    ----------
    pool, table
        Evidence of the tiles by slot, and the slots of those that the box touches, -1 for none.
    box
        row0, row1, col0, col1 (half open) in cells of the level.
    """
    row0, row1, col0, col1 = box
    out, side = np.empty((row1 - row0, col1 - col0, 2, FIELDS), np.float32), 1 << level
    first = (row0 << level) >> TILE_BITS, (col0 << level) >> TILE_BITS
    for r in range(row0, row1):
        fine = np.zeros((side, (col1 - col0) << level, 2, FIELDS), np.float32)
        copy_evidence(pool, table, first[0], first[1], r << level, col0 << level, fine)
        for _ in range(level):
            fine = downsample(fine, now_s, max_age_s)
        for c in range(out.shape[1]):
            for epoch in range(2):
                put(out[r - row0, c, epoch], 0, fine[0, c, epoch])
    return out
