"""The companion's clock: the event loop's time, so that a simulated loop makes simulated time."""

from __future__ import annotations

import asyncio


def now_ns() -> int:
    """Return the running loop's monotonic time in nanoseconds."""
    return round(asyncio.get_running_loop().time() * 1e9)
