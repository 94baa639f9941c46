"""Scores of a safe map against a truth: errors by kind of hazard, safe ground found, calibration."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.open_benchmark.footprint_truth import SceneTruth
from companion.desk.open_benchmark.landing_task import F64, SAFE, UNKNOWN, UNSAFE, SafeMap

Mask = NDArray[np.bool_]
EDGES = np.array([0.0, 0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0])
"""Edges of the bins of probability, closer where landings are decided."""
RANKS = 20_000  # steps of a probability, or of 1 / (1 + share of a limit), that the curve distinguishes
FOUND = (0.5, 0.6, 0.7, 0.8, 0.9)
"""Shares of the safe cells found at which the operating curve is read."""


@dataclass(slots=True)
class SafeMapCounts:
    """Counts of judged cells; those of several maps can be added.

    missed, unsafe: unsafe cells called safe, and all, by kind. found, safe: safe cells called safe, and all.
    bins: (bins, 3) cells, sum of probabilities and number truly safe. brier: sum of squared errors. ranks:
    (2, `RANKS`) unsafe and safe cells by the method's probability, the highest first; cells without a
    probability are left out.
    """

    missed: Counter[str] = field(default_factory=Counter)
    unsafe: Counter[str] = field(default_factory=Counter)
    found: int = 0
    safe: int = 0
    unknown: int = 0
    brier: float = 0.0
    bins: F64 = field(default_factory=lambda: np.zeros((len(EDGES) - 1, 3)))
    ranks: NDArray[np.int64] = field(default_factory=lambda: np.zeros((2, RANKS), np.int64))

    def add(self, other: SafeMapCounts) -> None:
        """Add the counts of another map."""
        self.missed.update(other.missed)
        self.unsafe.update(other.unsafe)
        self.found += other.found
        self.safe += other.safe
        self.unknown += other.unknown
        self.brier += other.brier
        self.bins = self.bins + other.bins
        self.ranks = self.ranks + other.ranks

    def figures(self) -> dict[str, Any]:
        """Return the shares as JSON, None where there is nothing to divide by.

        unsafe_called_safe: of the unsafe cells. safe_is_unsafe: of the cells called safe. safe_found: of the
        safe cells. unknown: of the judged cells. brier and reliability: over cells with a probability.
        operating_curve: unsafe called safe where the threshold is moved until a share of the safe cells is
        found; none of methods that give a map alone, None where no threshold finds as much.
        """
        missed, unsafe = self.missed.total(), self.unsafe.total()
        n = float(self.bins[:, 0].sum())
        return {
            "judged": unsafe + self.safe,
            "unsafe": unsafe,
            "unsafe_called_safe": _share(missed, unsafe),
            "safe_is_unsafe": _share(missed, missed + self.found),
            "safe_found": _share(self.found, self.safe),
            "unknown": _share(self.unknown, unsafe + self.safe),
            "by_kind": {
                kind: {"unsafe": total, "unsafe_called_safe": _share(self.missed[kind], total)}
                for kind, total in sorted(self.unsafe.items())
            },
            "operating_curve": [
                {"safe_found": found, "unsafe_called_safe": self._missed_at(found, unsafe)} for found in FOUND
            ]
            if self.ranks.any()
            else [],
            "brier": _share(self.brier, n),
            "reliability": [
                {
                    "from": float(low),
                    "to": float(high),
                    "cells": int(cells),
                    "mean": _share(total, cells),
                    "truly_safe": _share(true, cells),
                }
                for low, high, (cells, total, true) in zip(EDGES[:-1], EDGES[1:], self.bins, strict=True)
                if cells
            ],
        }

    def _missed_at(self, found: float, unsafe: int) -> float | None:
        """Return the share of unsafe cells called safe with a share of the safe ones; ties count in part."""
        missed, right = self.ranks.cumsum(axis=1)
        wanted = found * self.safe
        if not unsafe or not self.safe or right[-1] < wanted:
            return None
        at = int(np.searchsorted(right, wanted))
        before = np.array([missed[at - 1], right[at - 1]]) if at else np.zeros(2)
        part = (wanted - before[1]) / (right[at] - before[1])
        return float(before[0] + part * (missed[at] - before[0])) / unsafe


def score(answer: SafeMap, truth: SceneTruth) -> SafeMapCounts:
    """Count a safe map against a truth on the same grid; cells that are not judged count nowhere."""
    judged = truth.safe != UNKNOWN
    unsafe, safe = truth.safe == UNSAFE, truth.safe == SAFE
    called = answer.state == SAFE
    counts = SafeMapCounts(
        found=int((called & safe).sum()),
        safe=int(safe.sum()),
        unknown=int(((answer.state == UNKNOWN) & judged).sum()),
    )
    for index, kind in enumerate(truth.kinds):
        mine = unsafe & (truth.kind == index)
        if total := int(mine.sum()):
            counts.unsafe[kind] += total
            counts.missed[kind] += int((called & mine).sum())
    if answer.probability is not None:
        _calibrate(counts, answer.probability.astype(np.float64), judged, safe)
        _rank(counts, np.where(answer.state == UNKNOWN, np.nan, answer.probability), unsafe, safe)
    elif answer.limit_share is not None:
        _rank(counts, 1 / (1 + answer.limit_share.astype(np.float64)), unsafe, safe)
    return counts


def _rank(counts: SafeMapCounts, sureness: F64, unsafe: Mask, safe: Mask) -> None:
    """Count the cells of a truth by a sureness of 0 to 1; NaN where the method says nothing."""
    place = np.clip(np.floor((1 - np.nan_to_num(sureness)) * RANKS), 0, RANKS - 1).astype(np.int64)
    for row, cells in enumerate((unsafe, safe)):
        counts.ranks[row] += np.bincount(place[cells & np.isfinite(sureness)], minlength=RANKS)


def _calibrate(counts: SafeMapCounts, probability: F64, judged: Any, safe: Any) -> None:
    known = judged & np.isfinite(probability)
    p, true = probability[known], safe[known].astype(np.float64)
    counts.brier = float(((p - true) ** 2).sum())
    which = np.clip(np.searchsorted(EDGES, p, side="right") - 1, 0, len(EDGES) - 2)
    for column, weights in enumerate((np.ones(len(p)), p, true)):
        counts.bins[:, column] = np.bincount(which, weights, len(EDGES) - 1)


def _share(part: float, whole: float) -> float | None:
    return float(part) / float(whole) if whole else None
