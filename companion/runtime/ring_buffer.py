"""What was measured last, in memory that is taken once: hours of flight need no more than minutes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Recent:
    """The last rows of float64 that were appended, the oldest of them forgotten for each new one.

    Parameters
    ----------
    most
        Rows kept.
    shape
        Of a row: () for a number, (3,) for a place.
    """

    def __init__(self, most: int, shape: tuple[int, ...] = ()) -> None:
        self._rows = np.full((most, *shape), np.nan)  # written, so that the memory is resident from here on
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
        """The newest row; IndexError if there is none."""
        if not self._count:
            raise IndexError("nothing was appended yet")
        return self._rows[(self._count - 1) % len(self._rows)].copy()  # type: ignore[no-any-return]

    def array(self, most: int | None = None) -> NDArray[np.float64]:
        """Return a copy of the newest `most` rows, or of all, the oldest first: (n, ...)."""
        kept = len(self)
        n = kept if most is None else min(most, kept)
        return self._rows[np.arange(self._count - n, self._count) % len(self._rows)]
