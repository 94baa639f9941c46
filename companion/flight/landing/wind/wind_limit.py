"""Limit of the wind for a landing, with hysteresis."""

from __future__ import annotations

from companion.flight.geometry.wind import Wind

CALM_SHARE = 0.9  # of the limit, to which gusts must fall before a landing begins again
FORGET_NS = 60_000_000_000  # an unknown wind does not lift an exceeded limit sooner: the span of gusts


class WindLimit:
    """Whether gusts exceed the limit.

    Attributes
    ----------
    gust_ms
        Last known gust while the limit is exceeded, None otherwise.
    """

    def __init__(self) -> None:
        self.gust_ms: float | None = None
        self._known_ns = 0

    def follow(self, wind: Wind | None, limit_ms: float, now_ns: int) -> None:
        """Compare the present wind, None while it is unknown; an unknown wind exceeds nothing."""
        if wind is None:
            if now_ns - self._known_ns > FORGET_NS:
                self.gust_ms = None
            return
        self._known_ns = now_ns
        share = 1.0 if self.gust_ms is None else CALM_SHARE
        self.gust_ms = wind.gust_ms if wind.gust_ms > share * limit_ms else None
