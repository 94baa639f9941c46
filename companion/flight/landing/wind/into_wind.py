"""Heading into the wind for a touchdown, which does not follow each turn of the wind."""

from __future__ import annotations

import math

from companion.flight.geometry.wind import Wind

FROM_MS, UNTIL_MS = 2.0, 1.2  # mean speed from which the wind counts, and below which it ceases to
FOLLOW_RAD = math.radians(5.0)  # turn of the wind that the heading follows


class IntoWind:
    """Heading into the wind, held until the wind has turned by more than 5 degrees.

    Below 2 m/s the direction is not used: an error of the tilt by two degrees is as large.

    Attributes
    ----------
    heading_rad
        Clockwise from north; None without enough wind.
    """

    def __init__(self) -> None:
        self.heading_rad: float | None = None
        self._frozen = False

    def follow(self, wind: Wind | None) -> None:
        """Follow the present wind, None while it is unknown, unless frozen."""
        if self._frozen:
            return
        least_ms = FROM_MS if self.heading_rad is None else UNTIL_MS
        if wind is None or wind.speed_ms < least_ms:
            self.heading_rad = None
        elif self.heading_rad is None or abs(_turn_rad(wind.from_rad, self.heading_rad)) > FOLLOW_RAD:
            self.heading_rad = wind.from_rad

    def freeze(self, frozen: bool) -> None:
        """Keep the heading from the begin of a descent, whatever the wind does, or follow again."""
        self._frozen = frozen


def _turn_rad(to_rad: float, from_rad: float) -> float:
    return math.remainder(to_rad - from_rad, 2 * math.pi)
