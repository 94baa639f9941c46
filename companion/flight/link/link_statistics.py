"""Link statistics: counters, rates, delays and quality of the clock."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from companion.flight.link.clock.autopilot_clock import Source

WINDOW_NS = 2_000_000_000


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Snapshot of counters since the start; rates cover the last two seconds.

    Attributes
    ----------
    from_vehicle, lost
        Frames of the vehicle's autopilot, and gaps in their sequence numbers.
    bad, bad_bytes, unknown
        Broken frames; bytes outside any frame; messages that the dialect lacks.
    dropped
        Our messages that no open channel accepted.
    foreign
        Messages of other systems and components, ignored unless addressed to us.
    copies, old
        Frames delivered once more, which are not used; messages at least a second late among them and beside
        them.
    opened
        Number of times a channel was opened.
    missing
        Requested streams that are absent or slow.
    delay_p50_ms, delay_p99_ms
        Delays of the newest thousand stamped messages of the vehicle; None without TIMESYNC.
    residual_ms, worst_residual_ms
        Median and greatest distance of the trusted TIMESYNC exchanges from the line through them.
    unsigned, forged, replayed
        Frames refused because a key is set: without signature, with a wrong one, with an old timestamp.
    orders_refused
        Number of commands and parameter changes among them.
    refused
        Streams that the autopilot does not have.
    key_mismatch
        How the keys of MAVLink signing separate us from the vehicle, empty if they do not.
    """

    received: int
    from_vehicle: int
    lost: int
    bad: int
    bad_bytes: int
    unknown: int
    sent: int
    dropped: int
    foreign: int
    copies: int
    old: int
    opened: int
    rates_hz: dict[str, float]
    missing: tuple[str, ...]
    time_source: Source
    round_trip_ms: float
    residual_ms: float
    worst_residual_ms: float
    delay_p50_ms: float | None
    delay_p99_ms: float | None
    drift_ppm: float
    time_resets: int
    implausible_stamps: int
    commands_executed: int
    commands_repeated: int
    unsigned: int
    forged: int
    replayed: int
    orders_refused: int
    refused: tuple[str, ...] = ()
    key_mismatch: str = ""


def quantile_ms(values_ns: Collection[int], share: float) -> float | None:
    """Return the quantile `share` of values, in milliseconds; None if there are no values."""
    if not values_ns:
        return None
    return round(sorted(values_ns)[min(len(values_ns) - 1, int(share * len(values_ns)))] * 1e-6, 3)


class RateMeter:
    """Message rates by name, over windows of two seconds."""

    def __init__(self) -> None:
        self._begun_ns: int | None = None
        self._counts: dict[str, int] = {}
        self._rates_hz: dict[str, float] = {}

    def record(self, name: str, now_ns: int) -> None:
        """Count a message."""
        self._turn(now_ns)
        self._counts[name] = self._counts.get(name, 0) + 1

    def rates_hz(self, now_ns: int) -> dict[str, float]:
        """Return the rates over the newest full window."""
        self._turn(now_ns)
        return dict(self._rates_hz)

    def _turn(self, now_ns: int) -> None:
        if self._begun_ns is None:
            self._begun_ns = now_ns
        elapsed_ns = now_ns - self._begun_ns
        if elapsed_ns >= WINDOW_NS:
            self._rates_hz = {name: count * 1e9 / elapsed_ns for name, count in self._counts.items()}
            self._counts = {}
            self._begun_ns = now_ns
