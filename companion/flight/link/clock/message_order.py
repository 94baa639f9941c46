"""Order of the autopilot's messages by its own time, and restarts of that time.

A network, a radio or a router may deliver a message late, or once more: by its stamp it is older than another
of its kind, and says nothing new. A time that goes back is a restart only if it stays there: what continues
the time before comes no more, and TIMESYNC, where the autopilot answers it, agrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

from companion.runtime.frozen_record import replaced

# A time this far behind the newest contradicts it; a nearer one belongs to a message that was overtaken.
BEHIND_MS = 1000
# So does one ahead of it by more than a queue holds, or by a simulator that runs ten times as fast.
AHEAD_MS, FASTEST = 5000, 10
# For so long, on the autopilot's clock, another time must go on alone until it is believed; longer where
# TIMESYNC was answered before and is not now.
STAYS_MS, UNANSWERED_MS = 5000, 10_000
# Clocks of `time_usec` may be set; within this a message is late, beyond it its clock is another.
LATE_US = 10_000_000

Verdict = Literal["next", "old", "restart"]


@dataclass(frozen=True, slots=True)
class OtherTime:
    """Boot times that contradict the newest: first, newest and its arrival, and number of messages."""

    first_ms: int
    newest_ms: int
    heard_ns: int
    messages: int = 1


@dataclass(frozen=True, slots=True)
class MessageOrder:
    """Order of the messages received so far.

    Attributes
    ----------
    newest_ms
        Boot time of the newest message, None before the first.
    heard_ns
        Arrival of that message.
    settled
        Whether that time has gone on: a first stamp may be anything.
    other
        Boot times that contradict it, None without any.
    newest_us
        Greatest stamp of each kind of message.
    old
        Number of messages that contradicted the newest and proved to be old.
    """

    newest_ms: int | None = None
    heard_ns: int = 0
    settled: bool = False
    other: OtherTime | None = None
    newest_us: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    old: int = 0

    def judge(
        self, kind: str, boot_ms: int, now_ns: int, stays_ms: int = STAYS_MS
    ) -> tuple[MessageOrder, Verdict]:
        """Return the order with a message stamped by boot time, and what the message is."""
        if self.newest_ms is None or not (self.settled or self._continues(boot_ms, now_ns)):
            return self._with(kind, boot_ms * 1000, newest_ms=boot_ms, heard_ns=now_ns), "next"
        if not self._continues(boot_ms, now_ns):
            return self._contradicted(boot_ms, now_ns, stays_ms)
        if self._is_old(kind, boot_ms):
            return self, "old"
        believed = self._believed()
        if boot_step_ms(self.newest_ms, boot_ms) <= 0:
            return believed._with(kind, boot_ms * 1000), "next"
        return believed._with(kind, boot_ms * 1000, newest_ms=boot_ms, heard_ns=now_ns, settled=True), "next"

    def judge_other(self, message: Any) -> tuple[MessageOrder, Verdict]:
        """Return the order with a message whose stamp shows no restart, and the verdict on it."""
        kind, stamp_us = message.get_type(), _stamp_us(message)
        newest_us = self.newest_us.get(kind)
        if not stamp_us or stamp_us == newest_us:
            return self, "next"
        if newest_us is not None and 0 < newest_us - stamp_us <= LATE_US:
            return self, "old"
        return self._with(kind, stamp_us), "next"

    def answered(self, boot_ms: int, now_ns: int) -> tuple[MessageOrder, Verdict]:
        """Return the order with the autopilot's answer to our own TIMESYNC, which is never old."""
        if self.other is None:
            return self, "next"
        if self._continues(boot_ms, now_ns):
            return self._believed(), "next"
        return MessageOrder(boot_ms, now_ns, settled=True, old=self.old), "restart"

    def _continues(self, boot_ms: int, now_ns: int) -> bool:
        return self.newest_ms is None or _goes_on(self.newest_ms, boot_ms, AHEAD_MS, now_ns - self.heard_ns)

    def _contradicted(self, boot_ms: int, now_ns: int, stays_ms: int) -> tuple[MessageOrder, Verdict]:
        last = self.other
        other = OtherTime(boot_ms, boot_ms, now_ns, 1 if last is None else last.messages + 1)
        if last is not None and _goes_on(last.newest_ms, boot_ms, BEHIND_MS, now_ns - last.heard_ns):
            newest_ms = max(last.newest_ms, boot_ms)
            other = replaced(other, first_ms=last.first_ms, newest_ms=newest_ms)
        if other.newest_ms - other.first_ms >= stays_ms:
            return MessageOrder(other.newest_ms, now_ns, settled=True, old=self.old), "restart"
        return replaced(self, other=other), "old"

    def _is_old(self, kind: str, boot_ms: int) -> bool:
        newest_us = self.newest_us.get(kind)
        return newest_us is not None and boot_step_ms(newest_us // 1000, boot_ms) < 0

    def _believed(self) -> MessageOrder:
        """Return the order after the newest time was confirmed: what contradicted it is old."""
        if self.other is None:
            return self
        return replaced(self, other=None, old=self.old + self.other.messages)

    def _with(self, kind: str, stamp_us: int, **changes: Any) -> MessageOrder:
        return replaced(self, newest_us={**self.newest_us, kind: stamp_us}, **changes)


def _goes_on(newest_ms: int, boot_ms: int, ahead_ms: int, passed_ns: int) -> bool:
    """Return whether a boot time may follow, or be overtaken by, the newest, which is of `passed_ns` ago."""
    most_ms = ahead_ms + FASTEST * max(0, passed_ns) // 1_000_000
    return -BEHIND_MS < boot_step_ms(newest_ms, boot_ms) <= most_ms


def boot_step_ms(old_ms: int, new_ms: int) -> int:
    """Return the step between two 32-bit boot times, across their overflow; negative if time goes back."""
    return (new_ms - old_ms + 2**31) % 2**32 - 2**31


def _stamp_us(message: Any) -> int:
    """Return the stamp of a message in microseconds; zero without one."""
    boot_ms = getattr(message, "time_boot_ms", None)
    return int(getattr(message, "time_usec", 0)) if boot_ms is None else int(boot_ms) * 1000
