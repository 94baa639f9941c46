"""Clock of the program that recorded a log, which may be set while it records."""

from __future__ import annotations

from typing import Any

# Logs are in order of arrival, so a time that goes back means that the clock was set. One that goes forward
# may be a silence; it is none where the autopilot's own time went on by so much less.
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
        self._last_ns: int | None = None
        self._boot_ms: int | None = None
        self._gap_ns = 0  # from the frame before to the newest, while no boot time tells what it was
        self._gap_at_ns = 0

    def note(self, message: Any, at_ns: int) -> None:
        """Note a frame of the log, in order."""
        if self._last_ns is not None:
            gap_ns = at_ns - self._last_ns
            if gap_ns < -BACK_NS:
                self.steps.append((self._last_ns, gap_ns))
            elif gap_ns > FORWARD_NS:
                self._gap_ns, self._gap_at_ns = gap_ns, self._last_ns
        self._last_ns = at_ns
        boot_ms = getattr(message, "time_boot_ms", None)
        if boot_ms is None or message.get_srcComponent() != 1:
            return
        if self._gap_ns and self._boot_ms is not None:
            step_ns = self._gap_ns - (boot_ms - self._boot_ms) * 1_000_000
            if boot_ms > self._boot_ms and step_ns > FORWARD_NS:
                self.steps.append((self._gap_at_ns, step_ns))
        self._gap_ns, self._boot_ms = 0, boot_ms
