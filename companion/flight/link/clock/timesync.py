"""Clock synchronisation with the autopilot using MAVLink's TIMESYNC, without I/O.

We send our time; the autopilot answers with it and its own time. The answer was sent at the middle between
sending and receiving, within half the round trip. Only the quickest of the recent round trips are trusted,
and a straight line through them gives offset and drift between the two clocks.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

from companion.flight.link.clock.minimum_delay import MinimumDelay

FAST_NS = 200_000_000
HURRY_NS = 50_000_000  # between requests while the offset is in doubt
SLOW_NS = 1_000_000_000
# Exchanges at the fast rate before the slow one, and those needed before the offset is used.
FAST_COUNT = 25
NEEDED = 5
WINDOW = 40
# A round trip is trusted up to this much above the best of the window: the jitter of a good link.
GATE_NS = 1_500_000
REPLY_TIMEOUT_NS = 2_000_000_000
# Minimum span of a drift fit; over less, noise would pass for drift.
DRIFT_SPAN_NS = 10_000_000_000
# This many consecutive offsets that differ from the line by more than the round trips explain are a jump.
JUMP_NS = 10_000_000
JUMP_COUNT = 3
# Longer than a busy computer delays a simulated autopilot; if no exchange is quick for this long, the link is
# slow.
SLOW_LINK_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class Exchange:
    """Answered request: its middle in our time, our time minus the autopilot's, and its round trip.

    quick: the round trip is within `JUMP_NS` of the shortest recent one.
    """

    local_ns: int
    offset_ns: int
    round_trip_ns: int
    quick: bool


class TimeSync:
    """Offset between the companion's clock and the autopilot's.

    Parameters
    ----------
    salt
        0..999, added to our stamps so that two programs on one network never send the same one.

    Attributes
    ----------
    resets, strays
        Number of times it started over; number of replies that answer none of our requests.
    answered_ns
        Our time of the newest answer, None before any.
    confirmed_ns
        Our time of the newest exchange that confirmed the offset in use, None without any. An exchange slower
        than the quickest by more than `JUMP_NS` is too inaccurate to confirm it, unless all have been so for
        `SLOW_LINK_NS`: then the link is slow, and the autopilot is not delayed.
    """

    def __init__(self, salt: int = 0) -> None:
        self._salt = salt
        self._trips = MinimumDelay()
        self._slow_since_ns: int | None = None  # since when no exchange has been quick
        self._pending: dict[int, int] = {}  # stamp sent -> time of sending
        self._next_ns: int | None = None
        self._sent = 0
        self._asked_ns: int | None = None
        self.answered_ns: int | None = None
        self.resets = 0
        self.strays = 0
        self._clear()

    def _clear(self) -> None:
        self._window: deque[Exchange] = deque(maxlen=WINDOW)
        self._jumps: list[Exchange] = []
        self._reference_ns = 0
        self._offset_ns = 0.0
        self._drift = 0.0
        self._residual_ns = 0.0
        self._worst_ns = 0.0
        self._sent = 0
        self.confirmed_ns: int | None = None

    # ---- exchange -------------------------------------------------------------------------------

    def request(self, now_ns: int) -> int | None:
        """Return the stamp to send as ts1 (with tc1 = 0) if a request is due."""
        if self._next_ns is not None and now_ns < self._next_ns:
            return None
        self._next_ns = now_ns + (FAST_NS if self._sent < FAST_COUNT or self._jumps else SLOW_NS)
        self._sent += 1
        self._asked_ns = now_ns
        stamp = now_ns - now_ns % 1000 + self._salt
        for old in [old for old, sent in self._pending.items() if now_ns - sent > REPLY_TIMEOUT_NS]:
            del self._pending[old]
        self._pending[stamp] = now_ns
        return stamp

    def hurry(self) -> None:
        """Make the next request due 50 ms after the last one, because the offset is in doubt."""
        if self._asked_ns is not None and self._next_ns is not None:
            self._next_ns = min(self._next_ns, self._asked_ns + HURRY_NS)

    def reply(self, tc1: int, ts1: int, now_ns: int) -> bool:
        """Use the autopilot's answer: its time `tc1` and our stamp `ts1`, received at `now_ns`.

        Return whether it answers a request of ours in time, so that it is neither a copy nor late.
        """
        sent_ns = self._pending.pop(ts1, None)
        if sent_ns is None:
            self.strays += 1
            return False
        round_trip = now_ns - sent_ns
        if not 0 <= round_trip <= REPLY_TIMEOUT_NS or tc1 <= 0:
            return False
        self.answered_ns = now_ns
        middle = sent_ns + round_trip // 2
        quick = round_trip - self._trips.add(sent_ns, now_ns) <= JUMP_NS
        if quick:
            self._slow_since_ns = None
        elif self._slow_since_ns is None:
            self._slow_since_ns = now_ns
        self._add(Exchange(middle, middle - tc1, round_trip, quick))
        return True

    def reset(self) -> None:
        """Discard everything: the autopilot rebooted, or its clock is another one."""
        self._pending.clear()
        self._next_ns = None
        self.resets += 1
        self._trips = MinimumDelay()
        self._clear()

    def _add(self, exchange: Exchange) -> None:
        if self.synced and self._contradicts(exchange):
            self._jumps.append(exchange)
            if len(self._jumps) < JUMP_COUNT:
                self.hurry()  # stamps are wrong until the jump is accepted
                return
            jumps = self._jumps
            self.resets += 1
            self._clear()
            self._begin_with(jumps, exchange)
        elif self.synced or not self.resets:
            self._jumps.clear()
            if (
                exchange.quick or not self.synced
            ):  # many slow ones, requested in a hurry, would displace the good ones
                self._window.append(exchange)
        elif self._tells(exchange):  # the clock may have jumped again meanwhile
            self._begin_with([*self._window, exchange], exchange)
        if not self._window:
            return
        self._fit()
        error_ns = abs(exchange.offset_ns - self._offset_at(exchange.local_ns))
        if self.synced and self._tells(exchange) and error_ns <= _tolerance_ns(exchange):
            self.confirmed_ns = exchange.local_ns

    def _tells(self, exchange: Exchange) -> bool:
        """Return whether an exchange is informative: it is quick, or the link itself is slow."""
        since_ns = self._slow_since_ns
        return exchange.quick or (since_ns is not None and exchange.local_ns - since_ns >= SLOW_LINK_NS)

    def _begin_with(self, exchanges: list[Exchange], newest: Exchange) -> None:
        """Restart the window of a new clock with the exchanges that agree with the newest."""
        self._window.clear()
        most_ns = _tolerance_ns(newest)
        self._window.extend(e for e in exchanges if abs(e.offset_ns - newest.offset_ns) <= most_ns)

    def _contradicts(self, exchange: Exchange) -> bool:
        error = abs(exchange.offset_ns - self._offset_at(exchange.local_ns))
        return error > JUMP_NS + (exchange.round_trip_ns + self.round_trip_ns) / 2

    def _fit(self) -> None:
        """Fit offset and drift to the quickest exchanges of the window."""
        gate = self._gate_ns()
        good = [e for e in self._window if e.round_trip_ns <= gate]
        self._reference_ns = good[-1].local_ns
        base = good[-1].offset_ns  # relative to it, offsets keep their precision in floats
        offsets = [float(e.offset_ns - base) for e in good]
        times = [float(e.local_ns - self._reference_ns) for e in good]
        # An offset errs by half its round trip at most, so a wider spread is drift, over any span.
        drifts = times[-1] - times[0] >= DRIFT_SPAN_NS or max(offsets) - min(offsets) > gate + JUMP_NS
        self._drift = _slope(times, offsets) if drifts and len(good) >= NEEDED else 0.0
        level = median(o - self._drift * t for t, o in zip(times, offsets, strict=True))
        self._offset_ns = base + level
        errors = [abs(o - self._drift * t - level) for t, o in zip(times, offsets, strict=True)]
        self._residual_ns, self._worst_ns = median(errors), max(errors)

    def _gate_ns(self) -> int:
        """Return the greatest trusted round trip; at least a quarter of the exchanges are within it."""
        trips = sorted(e.round_trip_ns for e in self._window)
        enough = trips[min(len(trips), max(NEEDED, len(trips) // 4)) - 1]
        return max(trips[0] + GATE_NS, enough)

    # ---- use ------------------------------------------------------------------------------------

    @property
    def synced(self) -> bool:
        """True if the window holds enough exchanges for the offset to be used."""
        return len(self._window) >= NEEDED

    @property
    def round_trip_ns(self) -> int:
        """Best round trip of the recent ones, 0 before the first."""
        return min((e.round_trip_ns for e in self._window), default=0)

    @property
    def residual_ns(self) -> float:
        """Median distance of the trusted exchanges from the fit."""
        return self._residual_ns

    @property
    def worst_residual_ns(self) -> float:
        """Greatest distance of the trusted exchanges from the fit."""
        return self._worst_ns

    @property
    def drift_ppm(self) -> float:
        """Rate of our clock relative to the autopilot's, minus one, ppm."""
        return self._drift * 1e6

    def to_local_ns(self, autopilot_ns: int) -> int:
        """Return our time at which the autopilot's clock shows `autopilot_ns`.

        Raises
        ------
        ValueError
            If not synced yet.
        """
        if not self.synced:
            raise ValueError("the clocks are not synchronised yet")
        # offset(local) = offset + drift (local - reference), with local = autopilot + offset(local)
        elapsed = (autopilot_ns + self._offset_ns - self._reference_ns) / (1.0 - self._drift)
        return self._reference_ns + round(elapsed)

    def to_autopilot_ns(self, local_ns: int) -> int:
        """Return the autopilot's time at our time `local_ns`; raises like `to_local_ns`."""
        if not self.synced:
            raise ValueError("the clocks are not synchronised yet")
        return local_ns - round(self._offset_at(local_ns))

    def _offset_at(self, local_ns: int) -> float:
        return self._offset_ns + self._drift * (local_ns - self._reference_ns)


def _tolerance_ns(exchange: Exchange) -> int:
    """Return the offset error up to which an exchange agrees with the fit."""
    return JUMP_NS + (0 if exchange.quick else exchange.round_trip_ns // 2)


def answer(tc1: int, ts1: int, now_ns: int) -> tuple[int, int] | None:
    """Return (tc1, ts1) of the reply to another system's request, None if it is a reply itself.

    A zero would make the reply a request, so our clock's zero is sent as one.
    """
    return None if tc1 != 0 else (max(1, now_ns), ts1)


def _slope(times: list[float], values: list[float]) -> float:
    mean_time = sum(times) / len(times)
    mean_value = sum(values) / len(values)
    spread = sum((t - mean_time) ** 2 for t in times)
    if spread == 0:
        return 0.0
    rise = sum((t - mean_time) * (v - mean_value) for t, v in zip(times, values, strict=True))
    return rise / spread
