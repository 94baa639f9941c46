"""Ring buffer in preallocated memory: hours of flight need no more memory than minutes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class RingBuffer:
    """Ring buffer of float64 rows: each new row beyond the capacity replaces the oldest.

    Parameters
    ----------
    most
        Capacity in rows.
    shape
        Shape of a row: () for a scalar, (3,) for a position.
    """

    def __init__(self, most: int, shape: tuple[int, ...] = ()) -> None:
        self._rows = np.full((most, *shape), np.nan)  # filled, so that the memory is resident from the start
        self._count = 0

    def append(self, row: NDArray[np.float64] | float) -> None:
        self._rows[self._count % len(self._rows)] = row
        self._count += 1

    def clear(self) -> None:
        self._count = 0

    def __len__(self) -> int:
        return min(self._count, len(self._rows))

    @property
    def last(self) -> NDArray[np.float64]:
        """Newest row; IndexError if there is none."""
        if not self._count:
            raise IndexError("nothing was appended yet")
        return self._rows[(self._count - 1) % len(self._rows)].copy()  # type: ignore[no-any-return]

    def array(self, most: int | None = None) -> NDArray[np.float64]:
        """Return a copy of the newest `most` rows, or of all rows, the oldest first: (n, ...)."""
        kept = len(self)
        n = kept if most is None else min(most, kept)
        return self._rows[np.arange(self._count - n, self._count) % len(self._rows)]
