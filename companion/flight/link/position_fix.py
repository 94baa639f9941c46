"""Whether the autopilot's position can be believed, by what it says of its fix."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

log = logging.getLogger(__name__)

FIX_3D = 3  # GPS_FIX_TYPE
ABSOLUTE = 16  # EKF_POS_HORIZ_ABS and ESTIMATOR_POS_HORIZ_ABS
MESSAGES = frozenset({"GPS_RAW_INT", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS"})
# A position is waited with for so long, for an autopilot that tells of its fix does so within a second.
PATIENCE_NS = 3_000_000_000


@dataclass(frozen=True, slots=True)
class PositionFix:
    """What the autopilot said of its position; None is unknown.

    gps: GPS_FIX_TYPE of its first receiver. absolute: its estimator knows a position on the Earth, from
    whatever source, which is what its position messages tell.
    """

    gps: int | None = None
    absolute: bool | None = None

    @property
    def good(self) -> bool | None:
        """Whether its position is one: by the estimator, else by GPS; None while neither was heard."""
        if self.absolute is not None:
            return self.absolute
        return None if self.gps is None else self.gps >= FIX_3D

    def after(self, message: Any) -> PositionFix:
        """Return what is known after one of `MESSAGES`."""
        if message.get_type() == "GPS_RAW_INT":
            return replace(self, gps=int(message.fix_type))
        return replace(self, absolute=bool(message.flags & ABSOLUTE))


class PositionGate:
    """Holds positions back until one is believed; from then on all are, until the autopilot reboots.

    Without a word of its fix a position is believed after a while.

    Parameters
    ----------
    patience_ns
        How long to wait for that word; None: all positions are believed.

    Attributes
    ----------
    is_open
        Whether positions are believed by now.
    refused
        Positions held back.
    """

    def __init__(self, patience_ns: int | None = 0) -> None:
        self._patience_ns = patience_ns
        self._first_ns: int | None = None
        self.is_open = patience_ns is None
        self.refused = 0
        self._told = False

    def close(self) -> None:
        """Begin anew."""
        self._first_ns, self.is_open = None, self._patience_ns is None

    def lets(self, fix: PositionFix, now_ns: int) -> bool:
        """Tell whether a position that comes now is believed."""
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        if not self.is_open and self._patience_ns is not None:
            silent = fix.good is None and now_ns - self._first_ns >= self._patience_ns
            self.is_open = fix.good is True or silent
        self.refused += not self.is_open
        if fix.good is False and not self.is_open and not self._told:
            self._told = True
            log.warning("the autopilot has no fix: its position is not believed yet")
        return self.is_open
