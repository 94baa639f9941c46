"""Endurance: how long the battery lasts, by how fast its charge falls."""

from __future__ import annotations

from collections import deque

SECOND = 1_000_000_000
SPAN_NS = 300 * SECOND  # over which the charge's fall counts
LEAST_FALL_PCT = 2.0  # charges come in whole percents: after less than two the rate is a guess
RESERVE_PCT = 5.0  # left at the end: voltage breaks down below


class Endurance:
    """Time until the charge has fallen to 5 %, from its fall in the last five minutes.

    A charge that rises is another battery, or an estimate that was corrected: what was before is forgotten.
    """

    def __init__(self) -> None:
        self._charges: deque[tuple[int, float]] = deque()  # stamps and charges, at each change

    def follow(self, now_ns: int, charge_pct: float | None) -> None:
        """Follow the charge that the autopilot reports, None while it reports none."""
        if charge_pct is None:
            self._charges.clear()
            return
        if self._charges and charge_pct > self._charges[-1][1]:
            self._charges.clear()
        if not self._charges or charge_pct < self._charges[-1][1]:
            self._charges.append((now_ns, charge_pct))
        while len(self._charges) > 2 and now_ns - self._charges[1][0] >= SPAN_NS:
            self._charges.popleft()

    def left_s(self, now_ns: int) -> float | None:
        """Return the seconds left (0 at 5 % and below), None while the fall is unknown."""
        if not self._charges:
            return None
        (since_ns, first_pct), (at_ns, last_pct) = self._charges[0], self._charges[-1]
        if last_pct <= RESERVE_PCT:
            return 0.0
        if first_pct - last_pct < LEAST_FALL_PCT or at_ns == since_ns:
            return None
        rate_pct_s = (first_pct - last_pct) / ((at_ns - since_ns) / SECOND)
        return max(0.0, (last_pct - RESERVE_PCT) / rate_pct_s - (now_ns - at_ns) / SECOND)
