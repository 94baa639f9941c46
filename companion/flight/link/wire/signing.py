"""MAVLink 2 signing, without I/O: verification of received frames and timestamps of our own.

The signature is the first 48 bits of SHA-256 over key, frame, link number and timestamp (mavlink.io, "Message
signing"). pymavlink signs what we send. Received frames are verified here, because pymavlink accepts the
timestamp of a frame before its signature: one forged frame would lock out the sender that it names.
"""

from __future__ import annotations

import hashlib
import hmac
import time
from collections.abc import Callable
from typing import Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.wire.framing import SIGNATURE_BYTES, is_signed, message_id

Verdict = Literal["good", "allowed", "unsigned", "forged", "replayed"]

# 1 January 2015 UTC, and the unit of timestamps.
EPOCH_S = 1_420_070_400
TICKS_PER_S = 100_000
# A new sender may be this far behind the newest timestamp seen (mavlink.io).
NEW_STREAM_TICKS = 60 * TICKS_PER_S
# The timestamp in use exceeds the saved one by at most SAVE_TICKS plus a moment's traffic; a start begins
# MARGIN_TICKS beyond the saved one.
SAVE_TICKS = 10 * TICKS_PER_S
MARGIN_TICKS = 2 * SAVE_TICKS
HIGHEST_TICK = 2**48 - 1

# Radios insert these themselves and have no key; ArduPilot and MAVProxy accept them unsigned, too.
UNSIGNED_IDS = frozenset({mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_RADIO})


def wall_ticks() -> int:
    """Return the system's date in units of 10 microseconds since 2015, 0 before that."""
    return max(0, (time.time_ns() - EPOCH_S * 1_000_000_000) // 10_000)


class Signing:
    """Verifier of received frames, and source of the timestamps of our own.

    Parameters
    ----------
    secret
        32 bytes.
    saved_tick
        Last result of `to_save` in an earlier run, 0 if there was none.
    wall
        The date in ticks; timestamps follow it, but never go back with it.

    Attributes
    ----------
    good, allowed, unsigned, forged, replayed
        Number of frames by verdict; all but the first two are refused.
    """

    def __init__(self, secret: bytes, saved_tick: int = 0, wall: Callable[[], int] = wall_ticks) -> None:
        if len(secret) != 32:
            raise ValueError("a key has 32 bytes")
        self.secret = secret
        self._wall = wall
        # A saved value beyond the date means that the date was set back: continue from the saved value.
        self._tick = min(max(wall(), saved_tick + MARGIN_TICKS if saved_tick else 0), HIGHEST_TICK)
        self._saved_tick = saved_tick
        self._streams: dict[tuple[int, int, int], int] = {}
        self.good = self.allowed = self.unsigned = self.forged = self.replayed = 0

    @property
    def tick(self) -> int:
        """Newest timestamp, sent or received."""
        return self._tick

    @property
    def refused(self) -> int:
        """Number of frames refused."""
        return self.unsigned + self.forged + self.replayed

    def next_tick(self) -> int:
        """Return the timestamp of the next frame: the date, but always later than any before."""
        self._tick = min(max(self._tick + 1, self._wall()), HIGHEST_TICK)
        return self._tick

    def to_save(self) -> int | None:
        """Return the timestamp to store for the next start, None if it has advanced too little."""
        if self._tick - self._saved_tick < SAVE_TICKS:
            return None
        self._saved_tick = self._tick
        return self._tick

    def verify(self, frame: bytes | bytearray) -> Verdict:
        """Return the verdict on a whole frame, and count it."""
        verdict = self._verdict(bytes(frame))
        setattr(self, verdict, getattr(self, verdict) + 1)
        return verdict

    def _verdict(self, frame: bytes) -> Verdict:
        if message_id(frame) in UNSIGNED_IDS:
            return "allowed"
        if not is_signed(frame):
            return "unsigned"
        if not hmac.compare_digest(hashlib.sha256(self.secret + frame[:-6]).digest()[:6], frame[-6:]):
            return "forged"
        signature = frame[-SIGNATURE_BYTES:]
        stream, tick = (signature[0], frame[5], frame[6]), int.from_bytes(signature[1:7], "little")
        last = self._streams.get(stream)
        if tick < self._tick - NEW_STREAM_TICKS if last is None else tick <= last:
            return "replayed"
        self._streams[stream] = tick
        self._tick = max(self._tick, tick)
        return "good"
