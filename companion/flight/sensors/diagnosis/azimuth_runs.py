"""Runs of marked sectors around the circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def longest_run(marked: NDArray[np.bool_]) -> tuple[int, int] | None:
    """Return first index and length of the longest run, which may pass the end; None without a mark.

    marked: (n,), the last beside the first.
    """
    n = len(marked)
    if not marked.any():
        return None
    if marked.all():
        return 0, n
    start = int(np.argmin(marked))  # not marked, so no run passes the seam
    turned = np.concatenate(([False], np.roll(marked, -start), [False])).astype(np.int8)
    edges = np.diff(turned)
    first, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    k = int(np.argmax(end - first))
    return (int(first[k]) + start) % n, int(end[k] - first[k])
