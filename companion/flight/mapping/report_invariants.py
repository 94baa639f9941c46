"""Invariants of every report in flight: a report that breaks one is withdrawn."""

from __future__ import annotations

from collections import Counter
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from slz import SAFE, PointState, Report, Zone
from slz.grid import Box
from slz.report import MapReport

Which = Literal["near", "far"]
OLDEST_NS = 3_000_000_000
SOONEST_NS = 100_000_000  # clocks are more accurate than this


class BrokenInvariantError(RuntimeError):
    """Report that contradicts itself, its map, or time; the message says how."""


class LateReportError(BrokenInvariantError):
    """Report that is valid but too old to land by."""


class Verdicts(Protocol):
    """Maps from which a report was derived."""

    def state(self, which: Which, box: Box) -> NDArray[np.uint8]:
        """Return the states of a box: 0 unsafe, 1 safe, 255 unknown."""


class Invariants:
    """Checker of successive reports.

    Parameters
    ----------
    oldest_ns
        Age from which a report is too late to land by, from its window's end.
    """

    def __init__(self, oldest_ns: int = OLDEST_NS) -> None:
        self._oldest_ns = oldest_ns
        self._last_ns: int | None = None

    def check(self, report: Report, verdicts: Verdicts, now_ns: int) -> None:
        """Check a report.

        Raises
        ------
        BrokenInvariantError
            The report must not be published.
        """
        last_ns, self._last_ns = self._last_ns, report.stamp_ns
        if last_ns is not None and report.stamp_ns <= last_ns:
            back_s = (last_ns - report.stamp_ns) * 1e-9
            raise BrokenInvariantError(f"its stamp is {back_s:.3f} s before that of the last")
        late_ns = now_ns - report.stamp_ns
        if late_ns > self._oldest_ns:
            raise LateReportError(f"it is {late_ns * 1e-9:.1f} s late")
        if late_ns < -SOONEST_NS:
            raise BrokenInvariantError(f"its stamp is {-late_ns * 1e-9:.1f} s ahead of time")
        self._check_numbers((*report.near.zones, *report.far.zones))
        maps: tuple[tuple[Which, MapReport], ...] = (("near", report.near), ("far", report.far))
        for which, found in maps:
            for zone in found.zones:
                self._check_zone(zone, found, which, verdicts)
        selected = report.selected
        if selected is not None and selected.state is PointState.SAFE and selected.judged_by == "none":
            raise BrokenInvariantError("the landing point is safe in no map")

    def _check_numbers(self, zones: tuple[Zone, ...]) -> None:
        for number, count in Counter(zone.id for zone in zones).items():
            if count > 1:
                raise BrokenInvariantError(f"zone {number} is there {count} times")

    def _check_zone(self, zone: Zone, found: MapReport, which: Which, verdicts: Verdicts) -> None:
        numbers = np.array([zone.area_m2, zone.certainty, *zone.best.enu_m[:2], zone.best.certainty])
        if not np.isfinite(numbers).all() or not 0 <= zone.certainty <= 1 or zone.area_m2 <= 0:
            raise BrokenInvariantError(f"zone {zone.id} has numbers that cannot be")
        if not zone.holds(*found.grid.index(float(zone.best.enu_m[0]), float(zone.best.enu_m[1]))):
            raise BrokenInvariantError(f"the landing point of zone {zone.id} lies outside of it")
        wrong = int(((verdicts.state(which, zone.box) != SAFE) & (zone.cells == 1)).sum())
        if wrong:
            raise BrokenInvariantError(f"{wrong} cells of zone {zone.id} are not safe in the {which} map")
