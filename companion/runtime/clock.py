"""The companion's clock: the event loop's time, so that a simulated loop makes simulated time."""

from __future__ import annotations

import asyncio
import time


def now_ns() -> int:
    """Return the running loop's monotonic time in nanoseconds."""
    return round(asyncio.get_running_loop().time() * 1e9)


class WallOffset:
    """What the time of day is ahead of the companion's clock: measured once, for later it may be set."""

    def __init__(self) -> None:
        self._ns: int | None = None

    def __call__(self) -> int:
        """Return it in nanoseconds; first called within the running loop."""
        if self._ns is None:
            self._ns = time.time_ns() - now_ns()
        return self._ns
