"""Warnings to the pilot that the link swallowed: told again, with their age, when it is back."""

from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

KEPT = 8
KEPT_NS = 120_000_000_000
PREFIX = "SLZ: "


class UnheardTexts:
    """Keeps the newest texts of severity WARNING or worse."""

    def __init__(self) -> None:
        self._said: deque[tuple[int, str, int]] = deque(maxlen=KEPT)

    def note(self, text: str, severity: int, now_ns: int) -> None:
        """Take a text that was sent, heard or not."""
        if severity <= mavlink.MAV_SEVERITY_WARNING:
            self._said.append((now_ns, text, severity))

    def again(self, silent_since_ns: int, now_ns: int) -> list[tuple[str, int]]:
        """Return texts and severities to send again after a link was silent since a time, and forget all."""
        said = [entry for entry in self._said if silent_since_ns <= entry[0] and now_ns - entry[0] <= KEPT_NS]
        self._said.clear()
        return [
            (f"{PREFIX}{(now_ns - at_ns) * 1e-9:.0f} s ago: {text.removeprefix(PREFIX)}", severity)
            for at_ns, text, severity in said
        ]
