"""Classes of a survey as prior knowledge: what its maker said of each point (ASPRS LAS 1.4, table 17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
SHARE = 0.5  # of a cell's points, from which on their class is that of the cell
SCORE = 6.0  # log odds


@dataclass(frozen=True, slots=True)
class SurveyClasses:
    """Number of points of a cell by class, (rows, cols) each.

    building: class 6. low_plant: 3. tall_plant: 4 and 5. total: all points.
    """

    building: Floats
    low_plant: Floats
    tall_plant: Floats
    total: Floats

    def scores(self) -> Floats:
        """Return the log odds for a roof and for plants, and the share of tall ones, (3, rows, cols)."""
        return np.stack([self.for_roof(), self.for_plants(), self.tall_share()])

    def for_roof(self) -> Floats:
        """Return the log odds for a roof."""
        return self._score(self.building)

    def for_plants(self) -> Floats:
        """Return the log odds for plants."""
        return self._score(self.low_plant + self.tall_plant)

    def tall_share(self) -> Floats:
        """Return the share of tall ones among the plants, NaN where no point is a plant."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.tall_plant / (self.low_plant + self.tall_plant), np.float32)

    def _score(self, count: Floats) -> Floats:
        share = count / np.maximum(self.total, 1)
        return np.asarray(SCORE * np.clip(share / SHARE, 0, 1), np.float32)
