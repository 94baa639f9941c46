"""Clock of the program that recorded a log, which may be set while it records."""

from __future__ import annotations

from typing import Any

# Between two messages of the autopilot, the log's time and the autopilot's own go on alike. A time that goes
# back was set; one that goes far ahead, too (a message may come some seconds late).
BACK_NS, FORWARD_NS = 100_000_000, 10_000_000_000


class RecorderClock:
    """Finder of steps of the recorder's clock.

    Attributes
    ----------
    steps
        Time before each step and its size, positive forward (ns).
    """

    def __init__(self) -> None:
        self.steps: list[tuple[int, int]] = []
        self._last: tuple[int, int] | None = None  # time and boot time (ms)

    def note(self, message: Any, at_ns: int) -> None:
        """Note a message of the autopilot, in the order of the log."""
        boot_ms = getattr(message, "time_boot_ms", None)
        if boot_ms is None:
            return
        if self._last is not None and boot_ms > self._last[1]:
            gap_ns = at_ns - self._last[0]
            step_ns = gap_ns - (boot_ms - self._last[1]) * 1_000_000
            if gap_ns < -BACK_NS or step_ns > FORWARD_NS:
                self.steps.append((self._last[0], step_ns))
        self._last = at_ns, boot_ms
