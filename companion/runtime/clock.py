"""Monotonic clock of the companion: the event loop's time, hence simulated time in a simulated loop."""

from __future__ import annotations

import asyncio
import time


def now_ns() -> int:
    """Return the running loop's monotonic time in nanoseconds."""
    return round(asyncio.get_running_loop().time() * 1e9)


class WallOffset:
    """Offset of UTC from the companion's clock, measured once, because the time of day may be set later."""

    def __init__(self) -> None:
        self._ns: int | None = None

    def __call__(self) -> int:
        """Return the offset in nanoseconds; call it first within the running loop."""
        if self._ns is None:
            self._ns = time.time_ns() - now_ns()
        return self._ns
