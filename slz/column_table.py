"""Table of columns: a dataclass of arrays, one row in each for the same thing."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


class ColumnTable:
    """Base of dataclasses with slots whose fields are arrays of one length."""

    __slots__: tuple[str, ...] = ()

    def some(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Self:
        """Return some of the rows: those of a mask (n,), of indices in their order, or of a slice."""
        return type(self)(*(column[which] for column in self._columns()))

    def joined_with(self, other: Self) -> Self:
        """Return these rows and others."""
        pairs = zip(self._columns(), other._columns(), strict=True)
        return type(self)(*(np.concatenate(pair) for pair in pairs))

    def _columns(self) -> list[NDArray[Any]]:
        return [getattr(self, name) for name in self.__slots__]
