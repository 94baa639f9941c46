"""Watch over the selected point between two windows, for the landing under way."""

from __future__ import annotations

from companion.runtime.event import Event
from slz import Intrusion, Intrusions, Report, Scan

HELD_NS = 1_000_000_000  # after its last return; by then a window has judged the point


class PointWatch:
    """Compares every scan with the ground that the newest report left at the selected point.

    Attributes
    ----------
    on_intrusion
        Something came onto the point that was not there.
    count
        How often.
    """

    def __init__(self) -> None:
        self._intrusions = Intrusions()
        self._report: Report | None = None
        self._found: Intrusion | None = None
        self._found_ns = 0
        self.on_intrusion: Event[[]] = Event()
        self.count = 0

    def use_report(self, report: Report) -> None:
        """Watch the point of a report from now on."""
        before = None if self._report is None else self._report.selected
        now = report.selected
        if before is None or now is None or (before.enu_m != now.enu_m).any():
            self.forget()
        self._report = report

    def forget(self) -> None:
        """Forget point and intruder: a new map begins, or another point is selected."""
        self._report = self._found = None
        self._intrusions.forget()

    def add(self, scan: Scan, now_ns: int) -> None:
        """Compare a scan."""
        selected = None if self._report is None else self._report.selected
        found = self._intrusions.add(scan, None if selected is None else selected.ground)
        if found is None:
            return
        is_new = self.intrusion(now_ns) is None
        self._found, self._found_ns = found, now_ns
        if is_new:
            self.count += 1
            self.on_intrusion.emit()

    def intrusion(self, now_ns: int) -> Intrusion | None:
        """Return what is on the selected point now and was not there in the newest window, or None."""
        return self._found if now_ns - self._found_ns < HELD_NS else None
