"""Conversion of the autopilot's message stamps to the companion's clock."""

from __future__ import annotations

from collections import deque
from typing import Literal

from companion.flight.link.clock.minimum_delay import MinimumDelay
from companion.flight.link.clock.timesync import TimeSync

Source = Literal["none", "arrival", "timesync"]

# Boot times are 32-bit milliseconds and wrap around; TIMESYNC's are 64 bits and do not.
TURN_NS = 2**32 * 1_000_000
# A converted stamp cannot be in the future by more than the error of the mapping, nor older than any queue.
FUTURE_NS = 20_000_000
PAST_NS = 10_000_000_000
DOUBTS = 20
DELAYS = 1000
# A pose delayed by this much more than the quickest one is late, or its stamp is wrong.
LATE_NS = 20_000_000
# After this time without a TIMESYNC answer, stamps of the least delay are trusted again.
UNANSWERED_NS = 5_000_000_000
# If all poses were late for this long without a TIMESYNC answer, the clock has lost time since the last one.
DISPROVED_NS = 500_000_000


class AutopilotClock:
    """Conversion of the autopilot's boot time to the companion's clock, using TIMESYNC or the least delay.

    A clock that falls behind (a simulated autopilot's on a busy computer) is noticed at once, because its
    poses seem delayed for longer. Poses that wait in a queue look the same. Only the next exchange can show
    the two cases apart; until then, stamps are not certain.

    Attributes
    ----------
    timesync
        The exchange with the autopilot.
    implausible
        Number of stamps rejected because they would be in the future or too far back.
    delays_ns
        Delays of the newest messages from their stamps to their arrival; with TIMESYNC only.
    certain_ns
        Our time up to which stamps are certain, None before the first.
    mappings
        Number of new mappings that replaced one that proved wrong: stamps after `certain_ns` were wrong.
    """

    def __init__(self, salt: int = 0) -> None:
        self.timesync = TimeSync(salt)
        self.implausible = 0
        self.delays_ns: deque[int] = deque(maxlen=DELAYS)
        self._arrivals = MinimumDelay()
        self._resets = 0
        self._doubts = 0
        self._heard = False
        self._least = MinimumDelay()
        self._late_since_ns: int | None = None
        self._mapping: tuple[int, bool] = (0, False)
        self.certain_ns: int | None = None
        self.mappings = 0

    @property
    def source(self) -> Source:
        """Current source of converted stamps."""
        if self.timesync.synced:
            return "timesync"
        return "arrival" if self._heard else "none"

    def stamp_ns(self, boot_ms: int, now_ns: int) -> int | None:
        """Return our time of a pose stamped `boot_ms` that arrived now; None if the result is implausible.

        The clock learns from the pose, and starts over after many implausible ones.
        """
        self._heard = True
        anew = self._note_mapping()
        if self.timesync.resets != self._resets:  # discard the least delay from before the clock's jump
            self._resets, self._arrivals = self.timesync.resets, MinimumDelay()
        autopilot_ns = self._whole_ns(boot_ms, now_ns)
        stamp = autopilot_ns + self._arrivals.add(autopilot_ns, now_ns)
        if self.timesync.synced:
            stamp = self.timesync.to_local_ns(autopilot_ns)
        if now_ns - PAST_NS <= stamp <= now_ns + FUTURE_NS:
            self._doubts = 0
            if self.timesync.synced:
                self.delays_ns.append(max(0, now_ns - stamp))
            if not anew:  # users of a new mapping must first read up to when the old one was right
                self._judge(min(stamp, now_ns), now_ns)
            return min(stamp, now_ns)
        self.implausible += 1
        self._doubts += 1
        if self._doubts >= DOUBTS:  # no longer the clock that we synchronised with
            self.reset()
        return None

    def _note_mapping(self) -> bool:
        """Count a change of the mapping and return whether it changed."""
        mapping = self.timesync.resets, self.timesync.synced
        anew = mapping != self._mapping and self.timesync.resets > 0
        self.mappings += anew
        self._mapping = mapping
        return anew

    def _judge(self, stamp_ns: int, now_ns: int) -> None:
        """Advance `certain_ns` to a stamp with a normal delay, or to the newest confirming exchange."""
        sync = self.timesync
        known = [] if self.certain_ns is None else [self.certain_ns]
        if sync.synced:
            late = now_ns - stamp_ns - self._least.add(stamp_ns, now_ns) > LATE_NS
            known += [] if late else [stamp_ns]
            known += [] if sync.confirmed_ns is None else [min(sync.confirmed_ns, stamp_ns)]
        else:
            late = sync.resets > 0 and sync.answered_ns is not None and not self._unanswered(now_ns)
            known += [] if late else [stamp_ns]
        self.certain_ns = max(known, default=None)
        if not late:
            self._late_since_ns = None
        elif self._late_since_ns is None:
            self._late_since_ns = now_ns
        elif sync.synced and self._unanswered(now_ns) and now_ns - self._late_since_ns > DISPROVED_NS:
            self.reset()
        if late and (self.certain_ns is None or stamp_ns - self.certain_ns > LATE_NS):
            sync.hurry()

    def _unanswered(self, now_ns: int) -> bool:
        answered_ns = self.timesync.answered_ns
        return answered_ns is not None and now_ns - answered_ns >= UNANSWERED_NS

    def look_up_ns(self, boot_ms: int, now_ns: int) -> int | None:
        """Return our time of a message that is not a pose; the clock learns nothing from it.

        None before the first pose, or if the time is implausible.
        """
        autopilot_ns = self._whole_ns(boot_ms, now_ns)
        offset = self._arrivals.offset_ns if self.timesync.resets == self._resets else None
        if self.timesync.synced:
            stamp = self.timesync.to_local_ns(autopilot_ns)
        elif offset is not None:
            stamp = autopilot_ns + offset
        else:
            return None
        return min(stamp, now_ns) if now_ns - PAST_NS <= stamp <= now_ns + FUTURE_NS else None

    def _whole_ns(self, boot_ms: int, now_ns: int) -> int:
        """Unwrap a 32-bit boot time to the value nearest to the autopilot's clock now."""
        synced = self.timesync.synced
        clock_ns = self.timesync.to_autopilot_ns(now_ns) if synced else self._arrivals.autopilot_ns(now_ns)
        part_ns = boot_ms * 1_000_000
        turns = 0 if clock_ns is None else max(0, round((clock_ns - part_ns) / TURN_NS))
        return part_ns + turns * TURN_NS

    def reset(self) -> None:
        """Start over after a reboot of the autopilot."""
        self.timesync.reset()
        self._arrivals = MinimumDelay()
        self._doubts = 0
        self._late_since_ns = None
        self._least = MinimumDelay()
        self._heard = False
        self.delays_ns.clear()
