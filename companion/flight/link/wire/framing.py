"""MAVLink framer: finds checksummed frames in a byte stream with arbitrary data between them.

A candidate with a wrong checksum costs one byte, not its announced length, so that a frame inside a false one
is still found (pymavlink's parser drops up to 280 bytes there).
"""

from __future__ import annotations

from collections.abc import Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

import companion.flight.link.wire.current_mode  # noqa: F401 - adds a message to the dialect's table

V1_MAGIC, V2_MAGIC = 0xFE, 0xFD
SIGNATURE_BYTES = 13
_SIGNED = 0x01


class Framer:
    """Splitter of a stream into checksummed frames, with counters of invalid data.

    Attributes
    ----------
    bad_bytes, bad_frames, unknown
        Bytes outside any frame; candidates with a wrong checksum or length; frames of messages that the
        dialect does not know, whose checksum cannot be verified.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._excused = 0  # leading bytes of the buffer that belong to an unknown frame
        self.bad_bytes = 0
        self.bad_frames = 0
        self.unknown = 0

    def feed(self, data: bytes) -> Iterator[bytearray]:
        """Add bytes and return the frames that they complete."""
        self._buffer += data
        while (start := self._candidate()) is not None:
            self._skip(start)
            length = self._frame_length()
            if length is None or len(self._buffer) < length:
                return
            yield from self._accept_frame(length)
        self._skip(len(self._buffer))

    def complete_bytes(self, data: bytes) -> bytes:
        """Add bytes and return all bytes so far except those of an incomplete frame."""
        taken = bytes(self._buffer) + data
        for _ in self.feed(data):
            pass
        return taken[: len(taken) - len(self._buffer)]

    def reset(self) -> None:
        """Discard a partial frame."""
        self._skip(len(self._buffer))

    def _candidate(self) -> int | None:
        places = [place for magic in (V1_MAGIC, V2_MAGIC) if (place := self._buffer.find(magic)) >= 0]
        return min(places) if places else None

    def _frame_length(self) -> int | None:
        """Return the length of the frame at the start of the buffer, None while its header is incomplete."""
        buffer = self._buffer
        if buffer[0] == V1_MAGIC:
            return 8 + buffer[1] if len(buffer) >= 2 else None
        if len(buffer) < 3:
            return None
        if buffer[2] & ~_SIGNED:
            return 1  # unsupported incompatibility flags: not a frame for us
        return 12 + buffer[1] + (SIGNATURE_BYTES if buffer[2] & _SIGNED else 0)

    def _accept_frame(self, length: int) -> Iterator[bytearray]:
        frame = self._buffer[:length]
        message = mavlink.mavlink_map.get(message_id(frame)) if length > 1 else None
        if message is not None and _fits(frame, message) and _checksum_ok(frame, message.crc_extra):
            del self._buffer[:length]
            self._excused = max(0, self._excused - length)
            yield frame
            return
        if message is not None:
            self.bad_frames += 1
        elif length > 1 and self._excused == 0 and self._buffer[length : length + 1] in _BOUNDARY:
            self.unknown += 1
            self._excused = length
        self._skip(1)

    def _skip(self, count: int) -> None:
        excused = min(count, self._excused)
        self._excused -= excused
        self.bad_bytes += count - excused
        del self._buffer[:count]


_BOUNDARY = (b"", bytes([V1_MAGIC]), bytes([V2_MAGIC]))


def is_signed(frame: bytes | bytearray) -> bool:
    """Return whether a frame carries a signature."""
    return frame[0] == V2_MAGIC and bool(frame[2] & _SIGNED)


def sender(frame: bytes | bytearray) -> tuple[int, int]:
    """Return system and component ID in a frame's header."""
    return (frame[3], frame[4]) if frame[0] == V1_MAGIC else (frame[5], frame[6])


def message_id(frame: bytes | bytearray) -> int:
    """Return the message ID in a frame's header."""
    return frame[5] if frame[0] == V1_MAGIC else int.from_bytes(frame[7:10], "little")


def _fits(frame: bytearray, message: type[mavlink.MAVLink_message]) -> bool:
    """Return whether the payload is not too long; a newer MAVLink 2 sender may extend it."""
    return frame[0] == V2_MAGIC or frame[1] <= message.unpacker.size


def _checksum_ok(frame: bytearray, crc_extra: int) -> bool:
    end = len(frame) - (SIGNATURE_BYTES if is_signed(frame) else 0) - 2
    checksum = mavlink.x25crc(bytes(frame[1:end]) + bytes([crc_extra])).crc
    return bool(checksum == int.from_bytes(frame[end : end + 2], "little"))
