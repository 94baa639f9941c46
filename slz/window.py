"""Scans, and the windows of time they are gathered into (SLZ paper 3.1.1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame

LATE_NS = 2_000_000_000
MOST_LATE = 100  # scans
MOST_POINTS = 10_000_000  # of a window whose stamps stand still


@dataclass(frozen=True, slots=True)
class Scan:
    """Georeferenced returns of one sensor frame.

    points_enu_m : (n, 3) float64, in `frame`. stamp_ns : (n,) int64, the clock of the vehicle computer,
    not decreasing. sensor_enu_m : (3,) float64, where the sensor was at the last stamp,
    NaN where that is not known.
    """

    points_enu_m: NDArray[np.float64]
    stamp_ns: NDArray[np.int64]
    sensor_enu_m: NDArray[np.float64]
    frame: LocalFrame

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        if self.points_enu_m.shape != (n, 3) or self.points_enu_m.dtype != np.float64:
            raise ValueError(f"points must be ({n}, 3) float64, not {_form(self.points_enu_m)}")
        if self.stamp_ns.shape != (n,) or self.stamp_ns.dtype != np.int64:
            raise ValueError(f"stamps must be ({n},) int64, not {_form(self.stamp_ns)}")
        if self.sensor_enu_m.shape != (3,):
            raise ValueError(f"sensor position must be (3,), not {_form(self.sensor_enu_m)}")

    def __len__(self) -> int:
        return len(self.stamp_ns)


@dataclass(frozen=True, slots=True)
class Window(Scan):
    """Returns of all scans within one time window; same arrays as `Scan`."""

    start_ns: int
    end_ns: int


class Windower:
    """Gather scans until their own stamps span the window, then hand the window on.

    The scan whose stamps reach the window's end is not part of it: it starts the next one
    (SLZ thesis 3.2.1.1). Time stamps decide, never the arrival. A second sensor's scans may come late, by up
    to `LATE_NS`: they join the open window, or wait for the next, and neither open nor close one. A scan that
    is older still tells of a clock that went back, and starts a window.
    """

    def __init__(self, window_s: float) -> None:
        self.window_s = window_s
        self._scans: list[Scan] = []
        self._late: list[Scan] = []
        self._first_ns = 0  # of the scan that opened the window
        self._last: Window | None = None

    def add(self, scan: Scan) -> Window | None:
        """Take a scan; return the finished window if this scan starts a new one."""
        if not len(scan):
            return None
        window = self.flush() if self._scans and self._must_close(scan) else None
        if self._scans:
            self._scans.append(scan)
        elif window is None and self._is_late(scan):
            self._late.append(scan)
        else:
            self._scans = [*(late for late in self._late if late.frame == scan.frame), scan]
            self._first_ns, self._late = int(scan.stamp_ns[0]), []
        return window

    def _must_close(self, scan: Scan) -> bool:
        elapsed = int(scan.stamp_ns[0]) - self._first_ns
        over = elapsed >= round(self.window_s * 1e9) or sum(map(len, self._scans)) >= MOST_POINTS
        return over or elapsed < -LATE_NS or scan.frame != self._scans[-1].frame

    def _is_late(self, scan: Scan) -> bool:
        """Tell whether a scan began within the last window, as if it had missed it."""
        if self._last is None or scan.frame != self._last.frame or len(self._late) >= MOST_LATE:
            return False
        return -LATE_NS <= int(scan.stamp_ns[0]) - self._last.end_ns < 0

    def flush(self) -> Window | None:
        """Hand on what was gathered, complete or not; what came late for a window before is gone with it."""
        self._late = []
        if not self._scans:
            return None
        window = join(self._scans)
        self._scans, self._last = [], window
        return window


def join(scans: Iterable[Scan]) -> Window:
    """Join scans of one frame into a window, in their order; those of two sensors may not come in order."""
    scans = list(scans)
    newest = max(scans, key=lambda scan: int(scan.stamp_ns[-1]) if len(scan) else -1)
    stamps = np.concatenate([scan.stamp_ns for scan in scans])
    points = np.concatenate([scan.points_enu_m for scan in scans])
    points.setflags(write=False)
    stamps.setflags(write=False)
    return Window(
        points_enu_m=points,
        stamp_ns=stamps,
        sensor_enu_m=newest.sensor_enu_m,
        frame=newest.frame,
        start_ns=int(stamps.min()),
        end_ns=int(stamps.max()),
    )


def _form(array: NDArray[np.generic]) -> str:
    return f"{array.shape} {array.dtype}"
