"""Buffer of warnings that the link lost, sent again with their age after a reconnection."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

KEPT = 8
KEPT_NS = 120_000_000_000
PREFIX = "SLZ: "


class UnheardTexts:
    """Buffer of the newest texts of severity WARNING or worse; if full, the mildest and oldest go."""

    def __init__(self) -> None:
        self._said: dict[str, tuple[int, int]] = {}  # text -> time, severity

    def record(self, text: str, severity: int, now_ns: int) -> None:
        """Record a text that was sent, received or not; a repeated text replaces the earlier one."""
        if severity > mavlink.MAV_SEVERITY_WARNING:
            return
        self._said.pop(text, None)
        self._said[text] = now_ns, severity
        if len(self._said) > KEPT:
            mildest = max(severity for _, severity in self._said.values())
            del self._said[next(text for text, (_, severity) in self._said.items() if severity == mildest)]

    def to_resend(self, silent_since_ns: int, now_ns: int) -> list[tuple[str, int]]:
        """Return the texts and severities to send again after the link was silent since a time."""
        return [
            (f"{PREFIX}{(now_ns - at_ns) * 1e-9:.0f} s ago: {text.removeprefix(PREFIX)}", severity)
            for text, (at_ns, severity) in self._said.items()
            if silent_since_ns <= at_ns and now_ns - at_ns <= KEPT_NS
        ]
