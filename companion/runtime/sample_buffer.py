"""Buffer of stamped samples, preallocated, whose valid part is always contiguous and ordered."""

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
