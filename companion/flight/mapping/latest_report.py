"""Newest report of the present map, and until when it holds."""

from __future__ import annotations

from companion.flight.mapping.window_pace import WindowPace
from companion.runtime.clock import now_ns
from params import Parameters
from slz import Report


class LatestReport:
    """Newest report, for everyone who decides, shows or sends by it.

    Parameters
    ----------
    parameters
        Uses `window_s`.
    pace
        Pace of the windows: on a slow computer a report is older before the next one comes.

    Attributes
    ----------
    newest
        Newest report of the present map, None before the first.
    arrived_ns
        Its arrival on the companion's clock, None before the first.
    is_withdrawn
        True after a window that failed, until the next report.
    begun_ns
        Beginning of the present map, None for the first one.
    zones_seen
        IDs of all zones reported so far, on any map.
    """

    def __init__(self, parameters: Parameters, pace: WindowPace) -> None:
        self._parameters, self._pace = parameters, pace
        self.newest: Report | None = None
        self.arrived_ns: int | None = None
        self.begun_ns: int | None = None
        self.is_withdrawn = False
        self.zones_seen: set[int] = set()

    def use_report(self, report: Report) -> None:
        """Keep a report that has just come."""
        self.newest, self.arrived_ns, self.is_withdrawn = report, now_ns(), False
        self.zones_seen.update(zone.id for zone in report.zones)

    def withdraw(self, _reason: str) -> None:
        """Mark the report as withdrawn: the window after it failed."""
        self.is_withdrawn = True

    def begin_map(self) -> None:
        """Drop the report: it is of the map before."""
        self.newest, self.arrived_ns, self.begun_ns = None, None, now_ns()

    def fresh(self, at_ns: int) -> Report | None:
        """Return the newest report if it is of the last windows, which last up to 2 s over few returns."""
        return self.newest if self._is_within(self.arrived_ns, at_ns) else None

    def valid(self, at_ns: int) -> Report | None:
        """Return the newest report if it is fresh and not withdrawn."""
        return None if self.is_withdrawn else self.fresh(at_ns)

    def begins(self, at_ns: int) -> bool:
        """Return whether the present map is so new that no report of it is due yet."""
        return self._is_within(self.begun_ns, at_ns)

    def _is_within(self, since_ns: int | None, at_ns: int) -> bool:
        limit_s = self._pace.window_s + self._parameters.window_s + 1.0
        return since_ns is not None and at_ns - since_ns < round(limit_s * 1e9)
