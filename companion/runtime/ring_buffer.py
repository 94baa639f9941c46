"""Preallocated buffers: rows in a ring, and stamped samples in one contiguous, ordered part."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


class SampleBuffer:
    """Buffer of the newest `capacity` samples of `width` numbers each.

    Samples are appended; when the buffer of twice the capacity is full, its newer half moves to the front.
    """

    def __init__(self, width: int, capacity: int) -> None:
        self._capacity = capacity
        self._stamp_ns = np.zeros(2 * capacity, dtype=np.int64)
        self._values = np.zeros((2 * capacity, width))
        self._end = 0

    def __len__(self) -> int:
        return min(self._end, self._capacity)

    @property
    def _first(self) -> int:
        return max(0, self._end - self._capacity)

    @property
    def stamp_ns(self) -> NDArray[np.int64]:
        """Stamps (n,), strictly increasing; a view that the next `append` may change."""
        return self._stamp_ns[self._first : self._end]

    @property
    def values(self) -> NDArray[np.float64]:
        """Samples (n, width); a view that the next `append` may change."""
        return self._values[self._first : self._end]

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest sample, None if there is none."""
        return int(self._stamp_ns[self._end - 1]) if self._end else None

    def append(self, stamp_ns: int, values: ArrayLike) -> None:
        """Append a sample newer than all others."""
        if self._end == len(self._stamp_ns):
            self._stamp_ns[: self._capacity] = self._stamp_ns[self._capacity :]
            self._values[: self._capacity] = self._values[self._capacity :]
            self._end = self._capacity
        self._stamp_ns[self._end] = stamp_ns
        self._values[self._end] = values
        self._end += 1

    def drop_after(self, stamp_ns: int) -> int:
        """Remove the samples newer than a stamp; return their number."""
        kept = int(np.searchsorted(self.stamp_ns, stamp_ns, side="right"))
        dropped = len(self) - kept
        self._end -= dropped
        return dropped

    def clear(self) -> None:
        """Remove all samples."""
        self._end = 0


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
