"""Whose mode the vehicle is in: ours, one that we have asked it to leave, or the pilot's."""

from __future__ import annotations

from companion.flight.landing.situation import Situation

SETTLE_NS = 3_000_000_000  # a mode asked for shows so late at worst


class Custody:
    """Tells our own changes of mode from the pilot's.

    The guided mode is ours, but not when it shows, unasked for, after the landing mode that we asked for;
    a landing mode after we asked for it; and so is the mode that we asked the vehicle to leave, until it has
    obeyed.
    """

    def __init__(self) -> None:
        self._land_ns: int | None = None
        self._leaving: str | None = None
        self._shown = False  # the landing mode, since we asked for it
        self._lands = False  # as we asked it to, and it was not asked for anything else since

    def asks_to_land(self, s: Situation) -> None:
        """Note that the landing mode is asked for now."""
        self._land_ns, self._leaving, self._lands, self._shown = s.now_ns, None, False, False

    def asks_to_leave(self, s: Situation) -> None:
        """Note that the guided mode is asked for now."""
        self._leaving = None if s.guided else s.mode

    def asks_for_guided(self) -> None:
        """Note that the landing mode is to be left now."""
        self._lands = False

    def adopt_landing(self, s: Situation) -> None:
        """Take the landing mode that the vehicle is in as ours: a companion before this one asked for it."""
        self.asks_to_land(s)
        self._lands = self._shown = True

    def given_up(self) -> None:
        """Forget what was asked for."""
        self._land_ns, self._leaving, self._lands = None, None, False

    def lands_for_us(self, s: Situation) -> bool:
        """Tell whether the vehicle is in the landing mode because we asked for it."""
        return s.landing and self._shown and self._land_ns is not None

    def lost(self, s: Situation) -> bool:
        """Tell whether somebody else chose the mode that the vehicle is in."""
        if s.guided:
            self._leaving = None
            if self._lands:
                return True
            # Only a mode heard now tells that the landing mode has not come.
            late = s.heard and self._land_ns is not None and s.now_ns - self._land_ns > SETTLE_NS
            if self._shown or late:
                self._land_ns = None
            return False
        if s.landing and self._land_ns is not None:
            if not self._shown:  # shown before: it may have been asked to leave since
                self._shown = self._lands = True
            return False
        return s.mode != self._leaving
