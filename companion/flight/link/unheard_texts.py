"""Buffer of warnings that the link lost, sent again with their age when the vehicle is heard again."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

KEPT = 8
KEPT_NS = 120_000_000_000
SILENT_INTERVALS = 5  # mean intervals of the vehicle's messages, after which texts count as lost
LEAST_SILENT_NS, MOST_SILENT_NS = 400_000_000, 2_500_000_000  # limits of that silence
SMOOTHING = 0.05  # share of the newest interval in their mean
HEARTBEAT_NS = (
    1_000_000_000  # of every vehicle; a longer interval is an outage, and counts as this in the mean
)
PREFIX = "SLZ: "


class UnheardTexts:
    """Buffer of the newest texts of severity WARNING or worse; if full, the mildest and oldest go."""

    def __init__(self) -> None:
        self._said: dict[str, tuple[int, int]] = {}  # text -> time, severity
        self._heard_ns: int | None = None  # newest message of the vehicle
        self._interval_ns = float(HEARTBEAT_NS)  # mean between its messages

    def record(self, text: str, severity: int, now_ns: int) -> None:
        """Record a text that was sent, received or not; a repeated text replaces the earlier one."""
        if severity > mavlink.MAV_SEVERITY_WARNING:
            return
        self._said.pop(text, None)
        self._said[text] = now_ns, severity
        if len(self._said) > KEPT:
            mildest = max(severity for _, severity in self._said.values())
            del self._said[next(text for text, (_, severity) in self._said.items() if severity == mildest)]

    def on_heard(self, now_ns: int) -> list[tuple[str, int]]:
        """Record a message of the vehicle; return the texts and severities that its silence swallowed.

        The silence may be of any length that stands out from the usual interval of its messages, so that a
        text is sent again after an outage in which the link did not count as lost yet.
        """
        since_ns, self._heard_ns = self._heard_ns, now_ns
        if since_ns is None:
            return self._since(0, now_ns)
        interval_ns = now_ns - since_ns
        usual_ns = SILENT_INTERVALS * self._interval_ns
        silent = interval_ns > min(max(LEAST_SILENT_NS, usual_ns), MOST_SILENT_NS)
        self._interval_ns += SMOOTHING * (min(interval_ns, HEARTBEAT_NS) - self._interval_ns)
        return self._since(since_ns, now_ns) if silent else []

    def _since(self, silent_since_ns: int, now_ns: int) -> list[tuple[str, int]]:
        return [
            (f"{PREFIX}{(now_ns - at_ns) * 1e-9:.0f} s ago: {text.removeprefix(PREFIX)}", severity)
            for text, (at_ns, severity) in self._said.items()
            if silent_since_ns <= at_ns and now_ns - at_ns <= KEPT_NS
        ]
