"""State machine of one command to the autopilot, from the first try to its result, without I/O."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Outcome = Literal[
    "accepted",
    "temporarily_rejected",
    "denied",
    "unsupported",
    "failed",
    "cancelled",
    "timeout",
    "not_connected",
    "superseded",
    "unconfirmed",
]

_OUTCOMES: dict[int, Outcome] = {
    mavlink.MAV_RESULT_ACCEPTED: "accepted",
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "temporarily_rejected",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "unsupported",
    mavlink.MAV_RESULT_FAILED: "failed",
    6: "cancelled",  # MAV_RESULT_CANCELLED, which the dialect lacks
}
# After "in progress", the next acknowledgement must come within this time.
PROGRESS_TIMEOUT_NS = 10_000_000_000


@dataclass(frozen=True, slots=True)
class CommandResult:
    """Result of a command.

    Attributes
    ----------
    outcome
        The autopilot's answer; or `timeout` (no answer), `not_connected` (not sent), `superseded` (replaced
        by a newer command), `unconfirmed` (accepted, but the effect was not seen).
    tries
        Number of times it was sent.
    """

    command: int
    outcome: Outcome
    tries: int = 0

    @property
    def ok(self) -> bool:
        return self.outcome == "accepted"


@dataclass(frozen=True, slots=True)
class Command:
    """Command as sent: COMMAND_LONG, or COMMAND_INT if a frame is given.

    x, y: degrees x 1e7 (or metres x 1e4 in local frames) with a frame; z metres.
    """

    command: int
    params: tuple[float, ...] = ()
    frame: int | None = None
    x: int = 0
    y: int = 0
    z: float = 0.0

    def message(self, system: int, component: int, tries: int) -> Any:
        """Return the message of the n-th try (0 first); `confirmation` marks a repetition."""
        p = (*self.params, *(0.0,) * (7 - len(self.params)))
        if self.frame is None:
            return mavlink.MAVLink_command_long_message(system, component, self.command, min(tries, 255), *p)
        return mavlink.MAVLink_command_int_message(
            system, component, self.frame, self.command, 0, 0, *p[:4], self.x, self.y, self.z
        )


class CommandCall:
    """State of one command in progress: sent until answered, at most `tries` times."""

    def __init__(self, command: Command, timeout_ns: int, tries: int) -> None:
        self.command = command
        self.result: CommandResult | None = None
        self.progress_pct: int | None = None
        self._timeout_ns = timeout_ns
        self._left = tries
        self._sent = 0
        self._deadline_ns: int | None = None
        self._in_progress = False

    @property
    def deadline_ns(self) -> int | None:
        """Time of the next action of `poll`; None before the first poll."""
        return self._deadline_ns

    @property
    def unanswered(self) -> bool:
        """True if it has no result, or was superseded before the autopilot answered."""
        return self.result is None or self.result.outcome == "superseded"

    def poll(self, now_ns: int) -> int | None:
        """Return the number of the try (from 0) to send now, None if there is nothing to send."""
        if self.result is not None or (self._deadline_ns is not None and now_ns < self._deadline_ns):
            return None
        if self._left == 0 or self._in_progress:
            self._end("timeout")
            return None
        self._left -= 1
        self._sent += 1
        self._deadline_ns = now_ns + self._timeout_ns
        return self._sent - 1

    def acknowledge(self, message: Any, now_ns: int) -> None:
        """Process a COMMAND_ACK for this command."""
        if self.result is not None or message.command != self.command.command or self._sent == 0:
            return
        if message.result == mavlink.MAV_RESULT_IN_PROGRESS:
            self._in_progress = True
            self.progress_pct = message.progress if message.progress <= 100 else None
            self._deadline_ns = now_ns + max(PROGRESS_TIMEOUT_NS, self._timeout_ns)
            return
        self._end(_OUTCOMES.get(message.result, "failed"))

    def supersede(self) -> None:
        """End it because a newer command replaces it."""
        if self.result is None:
            self._end("superseded")

    def _end(self, outcome: Outcome) -> None:
        self.result = CommandResult(self.command.command, outcome, self._sent)
