"""Expanding square search pattern."""

from __future__ import annotations

from collections.abc import Iterator


def expanding_square(east_m: float, north_m: float, spacing_m: float) -> Iterator[tuple[float, float]]:
    """Yield the corners of an expanding square search about a point (legs 1, 1, 2, 2, 3, 3 ... spacings)."""
    steps = ((1, 0), (0, 1), (-1, 0), (0, -1))
    leg = 0
    while True:
        dx, dy = steps[leg % 4]
        length = spacing_m * (leg // 2 + 1)
        east_m, north_m = east_m + dx * length, north_m + dy * length
        leg += 1
        yield east_m, north_m
