"""Plausibility gate for the autopilot's position, based on its reported fix."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

log = logging.getLogger(__name__)

FIX_3D = 3  # GPS_FIX_TYPE
ABSOLUTE = 16  # EKF_POS_HORIZ_ABS and ESTIMATOR_POS_HORIZ_ABS
MESSAGES = frozenset({"GPS_RAW_INT", "GPS2_RAW", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS"})
# A position is withheld this long, because an autopilot that reports its fix does so within a second.
PATIENCE_NS = 3_000_000_000


@dataclass(frozen=True, slots=True)
class PositionFix:
    """Reported quality of the autopilot's position; None is unknown.

    gps, second: GPS_FIX_TYPE of its two receivers. absolute: its estimator has a global position from any
    source; this is the position that its messages carry.
    """

    gps: int | None = None
    second: int | None = None
    absolute: bool | None = None

    @property
    def good(self) -> bool | None:
        """True if the position is valid according to the estimator, else to GPS; None before a report."""
        if self.absolute is not None:
            return self.absolute
        fixes = [fix for fix in (self.gps, self.second) if fix is not None]
        return max(fixes) >= FIX_3D if fixes else None

    def updated(self, message: Any) -> PositionFix:
        """Return the quality updated with one of `MESSAGES`."""
        if message.get_type() == "GPS_RAW_INT":
            return replace(self, gps=int(message.fix_type))
        if message.get_type() == "GPS2_RAW":
            return replace(self, second=int(message.fix_type))
        return replace(self, absolute=bool(message.flags & ABSOLUTE))


class PositionGate:
    """Gate that withholds positions until one is trusted; then all pass until the autopilot reboots.

    Without a report of the fix, positions are trusted after a while.

    Parameters
    ----------
    patience_ns
        Time to wait for that report; None: all positions pass.

    Attributes
    ----------
    is_open
        Whether positions pass now.
    refused
        Number of positions withheld.
    """

    def __init__(self, patience_ns: int | None = 0) -> None:
        self._patience_ns = patience_ns
        self._first_ns: int | None = None
        self.is_open = patience_ns is None
        self.refused = 0
        self._warned = False

    def close(self) -> None:
        """Restart with no position trusted."""
        self._first_ns, self.is_open = None, self._patience_ns is None

    def accepts(self, fix: PositionFix, now_ns: int) -> bool:
        """Return whether a position that arrives now is trusted."""
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        if not self.is_open and self._patience_ns is not None:
            silent = fix.good is None and now_ns - self._first_ns >= self._patience_ns
            self.is_open = fix.good is True or silent
        self.refused += not self.is_open
        if fix.good is False and not self.is_open and not self._warned:
            self._warned = True
            log.warning("the autopilot has no fix: its position is not believed yet")
        return self.is_open
