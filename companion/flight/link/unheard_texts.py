"""Buffer of warnings that the link lost, sent again with their age when the vehicle is heard again.

A text about a state, such as a missing input, is sent again only if that still lasts a moment later: the
message that ends the silence may end the state, too.
"""

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
JUDGED_NS = 1_500_000_000  # from the first message until a state is known: an input is back after a second
PREFIX = "SLZ: "


class UnheardTexts:
    """Buffer of the newest texts of severity WARNING or worse; if full, the mildest and oldest go.

    Attributes
    ----------
    lasting
        The text about the state that lasts now, "" without one; set it before the text is recorded.
    """

    def __init__(self) -> None:
        self.lasting = ""
        self._states: set[str] = set()  # of the texts said, those about a state
        self._awaited: list[str] = []  # of these, what the last silence swallowed
        self._judged_ns = 0
        self._said: dict[str, tuple[int, int]] = {}  # text -> time, severity
        self._heard_ns: int | None = None  # newest message of the vehicle
        self._interval_ns = float(HEARTBEAT_NS)  # mean between its messages

    def record(self, text: str, severity: int, now_ns: int) -> None:
        """Record a text that was sent, received or not; a repeated text replaces the earlier one."""
        if severity > mavlink.MAV_SEVERITY_WARNING:
            return
        self._said.pop(text, None)
        self._said[text] = now_ns, severity
        if text == self.lasting:
            self._states.add(text)
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
        return self._since(since_ns, now_ns) if silent else self._still_true(now_ns)

    def _since(self, silent_since_ns: int, now_ns: int) -> list[tuple[str, int]]:
        swallowed = [
            text
            for text, (at_ns, _) in self._said.items()
            if silent_since_ns <= at_ns and now_ns - at_ns <= KEPT_NS
        ]
        self._awaited += [text for text in swallowed if text in self._states]
        self._judged_ns = now_ns + JUDGED_NS
        return [self._again(text, now_ns) for text in swallowed if text not in self._states]

    def _still_true(self, now_ns: int) -> list[tuple[str, int]]:
        """Return the text about a state that was swallowed and still lasts, once that is known."""
        if not self._awaited or now_ns < self._judged_ns:
            return []
        awaited, self._awaited = self._awaited, []
        lasts = self.lasting in awaited and self.lasting in self._said
        return [self._again(self.lasting, now_ns)] if lasts else []

    def _again(self, text: str, now_ns: int) -> tuple[str, int]:
        at_ns, severity = self._said[text]
        age_s = (now_ns - at_ns) * 1e-9
        return f"{PREFIX}{age_s:.0f} s ago: {text.removeprefix(PREFIX)}", severity
