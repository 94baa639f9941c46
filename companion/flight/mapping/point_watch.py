"""Watch between two windows: what comes onto the selected point, and what moves around the vehicle."""

from __future__ import annotations

from companion.runtime.event import Event
from slz import Intrusion, Intrusions, MovingObject, MovingObjects, Report, Scan, SelectedPoint

MOVED_NS = 600_000_000  # after its last scan, in which something that moves is still believed
HELD_NS = 1_000_000_000  # after its last return; by then a window has judged the point


class PointWatch:
    """Compares every scan with the ground of the newest report.

    Parameters
    ----------
    angle_noise_rad
        Standard deviation of a ray's direction.

    Attributes
    ----------
    on_intrusion
        Something came onto the point that was not there.
    """

    def __init__(self, angle_noise_rad: float) -> None:
        self._intrusions, self._objects = Intrusions(), MovingObjects(angle_noise_rad)
        self._selected: SelectedPoint | None = None
        self._found: Intrusion | None = None
        self._found_ns = 0
        self.on_intrusion: Event[[]] = Event()

    def use_report(self, report: Report) -> None:
        """Watch the point of a report from now on."""
        before, now = self._selected, report.selected
        if before is None or now is None or (before.enu_m[:2] != now.enu_m[:2]).any():
            self._forget_point()
        self._selected = now
        self._objects.use_ground(report.nearby)

    def forget(self) -> None:
        """Forget everything: a new map begins."""
        self._forget_point()
        self._objects.forget()

    def _forget_point(self) -> None:
        self._selected = self._found = None
        self._intrusions.forget()

    def add(self, scan: Scan, now_ns: int) -> None:
        """Compare a scan."""
        self._objects.add(scan)
        selected = self._selected
        found = self._intrusions.add(scan, None if selected is None else selected.ground)
        if found is None:
            return
        is_new = self.intrusion(now_ns) is None
        self._found, self._found_ns = found, now_ns
        if is_new:
            self.on_intrusion.emit()

    def moving(self, now_ns: int) -> tuple[MovingObject, ...]:
        """Return what moves around the vehicle now."""
        return tuple(one for one in self._objects.found if now_ns - one.stamp_ns < MOVED_NS)

    def intrusion(self, now_ns: int) -> Intrusion | None:
        """Return what is on the selected point now and was not there in the newest window, or None."""
        return self._found if now_ns - self._found_ns < HELD_NS else None
