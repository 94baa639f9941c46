"""MCAP file in uncompressed chunks, with what a replay needs and nothing for display.

Format: https://mcap.dev/spec, version 0. A file that was not closed ends after its last flushed chunk.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from companion.flight.recorder import journal
from companion.flight.recorder.topics import PARAMETERS

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, METADATA, DATA_END = 1, 2, 3, 4, 5, 6, 12, 15
SCHEMAS = (
    ("mavlink.Frame", "", b""),
    ("slz.Packets", "", b""),
    ("slz.Object", "jsonschema", b'{"type": "object"}'),
)
CHANNELS = {  # number of the schema, encoding of the messages
    journal.MAVLINK_IN: (1, "mavlink"),
    journal.MAVLINK_OUT: (1, "mavlink"),
    **dict.fromkeys((journal.LIDAR, journal.ODOMETRY), (2, "slz.packets")),
    **dict.fromkeys((journal.EVENT, journal.REPORT, journal.GAP, PARAMETERS), (3, "json")),
}


class PlainMcap:
    """Writer of one file.

    Raises
    ------
    OSError
        The file cannot be created.
    """

    def __init__(self, path: Path, chunk_bytes: int) -> None:
        self._chunk_bytes = chunk_bytes
        self._file: BinaryIO = path.open("xb")
        self._chunk = bytearray()
        self._first_ns, self._last_ns = 2**64 - 1, 0
        self._file.write(MAGIC + _record(HEADER, _text("") + _text("slz")))
        for number, (name, encoding, data) in enumerate(SCHEMAS, 1):
            self._chunk += _record(
                SCHEMA, struct.pack("<H", number) + _text(name) + _text(encoding) + _bytes(data)
            )
        for number, (topic, (schema, encoding)) in enumerate(CHANNELS.items()):
            head = struct.pack("<HH", number, schema)
            self._chunk += _record(CHANNEL, head + _text(topic) + _text(encoding) + _map({}))

    def channels(self) -> Mapping[str, PlainChannel]:
        """Return the channel of every topic that a replay reads."""
        return {topic: PlainChannel(self, number) for number, topic in enumerate(CHANNELS)}

    def write_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write named texts."""
        self._file.write(_record(METADATA, _text(name) + _map(values)))

    def write_message(self, channel: int, log_time_ns: int, data: bytes) -> None:
        """Write a message; it reaches the file with its chunk."""
        head = struct.pack("<HIQQ", channel, 0, log_time_ns, log_time_ns)
        self._chunk += _record(MESSAGE, head + data)
        self._first_ns, self._last_ns = min(self._first_ns, log_time_ns), max(self._last_ns, log_time_ns)
        if len(self._chunk) >= self._chunk_bytes:
            self._end_chunk()

    def flush(self) -> None:
        """Pass everything to the operating system."""
        self._end_chunk()
        self._file.flush()

    def close(self) -> None:
        """End the file."""
        try:
            self._end_chunk()
            self._file.write(_record(DATA_END, struct.pack("<I", 0)))
            self._file.write(_record(FOOTER, struct.pack("<QQI", 0, 0, 0)) + MAGIC)
        finally:
            self._file.close()

    def _end_chunk(self) -> None:
        if not self._chunk:
            return
        chunk, self._chunk = bytes(self._chunk), bytearray()
        first_ns = min(self._first_ns, self._last_ns)
        head = struct.pack("<QQQI", first_ns, self._last_ns, len(chunk), zlib.crc32(chunk))
        self._file.write(_record(CHUNK, head + _text("") + struct.pack("<Q", len(chunk)) + chunk))
        self._first_ns, self._last_ns = 2**64 - 1, 0


class PlainChannel:
    """One topic of a file, with the interface of a channel of Foxglove's library."""

    def __init__(self, file: PlainMcap, number: int) -> None:
        self._file, self._number = file, number

    def log(self, message: bytes, *, log_time: int) -> None:
        """Write a message with its time of day, ns."""
        self._file.write_message(self._number, log_time, message)


def _record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def _bytes(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _bytes(text.encode())


def _map(values: Mapping[str, str]) -> bytes:
    return _bytes(b"".join(_text(name) + _text(value) for name, value in values.items()))
