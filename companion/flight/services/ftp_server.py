"""Read-only server of the MAVLink File Transfer Protocol for a few files in memory, without I/O.

There is no file system behind it: a path is a key of the given files, or it does not exist. Requests that
would change something are refused. Every request can be repeated without harm, so a lost answer needs no
memory of it.
"""

from __future__ import annotations

import struct
import zlib
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

HEADER = struct.Struct(
    "<HBBBBBxI"
)  # sequence, session, opcode, size, requested opcode, burst complete, offset
PAYLOAD_BYTES = 251
DATA_BYTES = PAYLOAD_BYTES - HEADER.size
SIZE = struct.Struct("<I")
# A file that a crashed station left open makes room for others, the one unused for longest first.
MOST_OPEN = 8
# Interval of a burst: 2.6 kB/s, less than half the rate of a 57600 baud radio.
BURST_INTERVAL_NS = 100_000_000
# A burst ends after this many parts: a station that has sent nothing for some seconds gives up.
BURST_PARTS = 16


class Opcode(IntEnum):
    """Requests that are answered, and the two kinds of answer."""

    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


CHANGING = frozenset(range(6, 14))  # create, write, remove, truncate and rename


class Fault(IntEnum):
    """Error codes of a NAK."""

    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


@dataclass(frozen=True, slots=True)
class _Request:
    sender: tuple[int, int]
    sequence: int
    session: int
    opcode: int
    size: int
    offset: int
    data: bytes

    @property
    def key(self) -> tuple[int, int, int]:
        return (*self.sender, self.session)

    @property
    def most(self) -> int:
        """Number of bytes that an answer may have; 0 leaves it to the server."""
        return self.size or DATA_BYTES


@dataclass(slots=True)
class _Burst:
    request: _Request
    sequence: int
    offset: int
    left: int = BURST_PARTS


class _RefusedError(Exception):
    """Refusal of a request."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.name)
        self.fault = fault


class FtpServer:
    """Serves files for reading: list, open, read, burst read, CRC.

    Parameters
    ----------
    files
        Contents by absolute path, all in the root folder.

    Attributes
    ----------
    refused
        Number of requests answered with an error other than the end of a file.
    """

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self._files = dict(files)
        self._open: OrderedDict[tuple[int, int, int], bytes] = OrderedDict()
        self._bursts: OrderedDict[tuple[int, int, int], _Burst] = OrderedDict()
        self._next_ns = 0
        self.refused = 0

    def on_message(self, message: Any, system: int, component: int) -> list[Any]:
        """Return the answers to a FILE_TRANSFER_PROTOCOL message; begin a burst that `poll` continues.

        Only a message for this component alone is answered: the autopilot serves files, too.
        """
        if message.get_type() != "FILE_TRANSFER_PROTOCOL":
            return []
        if (message.target_system, message.target_component) != (system, component):
            return []
        request = _request(message)
        if request.opcode in (Opcode.ACK, Opcode.NAK):
            return []
        try:
            return [_answer(request, Opcode.ACK, data) for data in self._answers(request)]
        except _RefusedError as refusal:
            self.refused += refusal.fault is not Fault.END_OF_FILE
            return [_answer(request, Opcode.NAK, bytes([refusal.fault]))]

    def poll(self, now_ns: int) -> list[Any]:
        """Return the next part of a burst, if it is due; bursts take turns."""
        if not self._bursts or now_ns < self._next_ns:
            return []
        self._next_ns = now_ns + BURST_INTERVAL_NS
        key, burst = self._bursts.popitem(last=False)
        content, request = self._open[key], burst.request
        part = content[burst.offset : burst.offset + request.most]
        burst.left -= 1
        end = burst.left == 0 or burst.offset + len(part) >= len(content)
        answer = _answer(
            request, Opcode.ACK, part, sequence=burst.sequence, offset=burst.offset, complete=end
        )
        if not end:
            burst.sequence, burst.offset = burst.sequence + 1, burst.offset + len(part)
            self._bursts[key] = burst
        return [answer]

    def _answers(self, request: _Request) -> list[bytes]:
        """Return the data of the answers to a request; raise `_RefusedError` to refuse it."""
        opcode = request.opcode
        if opcode in CHANGING:
            raise _RefusedError(Fault.FILE_PROTECTED)
        if request.size > DATA_BYTES:
            raise _RefusedError(Fault.INVALID_DATA_SIZE)
        if opcode == Opcode.TERMINATE_SESSION:
            self._close(request.key)
            return [b""]
        if opcode == Opcode.RESET_SESSIONS:
            for key in [key for key in self._open if key[:2] == request.sender]:
                self._close(key)
            return [b""]
        if opcode == Opcode.LIST_DIRECTORY:
            return [self._listed(request)]
        if opcode == Opcode.OPEN_FILE_RO:
            return [SIZE.pack(len(self._opened(request)))]
        if opcode == Opcode.CALC_FILE_CRC32:
            return [SIZE.pack(mavlink_crc32(self._named(request)))]
        if opcode == Opcode.READ_FILE:
            return [self._read(request)]
        if opcode == Opcode.BURST_READ_FILE:
            self._read(request)  # refuses a session that is not open, and an offset past the end
            self._bursts[request.key] = _Burst(request, request.sequence + 1, request.offset)
            self._bursts.move_to_end(request.key)
            return []
        raise _RefusedError(Fault.UNKNOWN_COMMAND)

    def _close(self, key: tuple[int, int, int]) -> None:
        self._open.pop(key, None)
        self._bursts.pop(key, None)

    def _named(self, request: _Request) -> bytes:
        content = self._files.get(_path(request))
        if content is None:
            raise _RefusedError(Fault.FILE_NOT_FOUND)
        return content

    def _opened(self, request: _Request) -> bytes:
        content = self._named(request)
        self._close(request.key)
        self._open[request.key] = content
        if len(self._open) > MOST_OPEN:
            self._close(next(iter(self._open)))
        return content

    def _read(self, request: _Request) -> bytes:
        content = self._open.get(request.key)
        if content is None:
            raise _RefusedError(Fault.INVALID_SESSION)
        self._open.move_to_end(request.key)
        if request.offset >= len(content):
            raise _RefusedError(Fault.END_OF_FILE)
        return content[request.offset : request.offset + request.most]

    def _listed(self, request: _Request) -> bytes:
        if _path(request) != "/":
            raise _RefusedError(Fault.FILE_NOT_FOUND)
        entries = [f"F{path[1:]}\t{len(content)}\0".encode() for path, content in self._files.items()]
        listed = b""
        for entry in entries[request.offset :]:
            if len(listed) + len(entry) > DATA_BYTES:
                break
            listed += entry
        if not listed:
            raise _RefusedError(Fault.END_OF_FILE)
        return listed


def mavlink_crc32(data: bytes) -> int:
    """Return the CRC-32 of MAVLink: the usual polynomial, but beginning with 0 and without inversion."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _request(message: Any) -> _Request:
    payload = bytes(message.payload[:PAYLOAD_BYTES])
    sequence, session, opcode, size, _, _, offset = HEADER.unpack_from(payload)
    sender = (message.get_srcSystem(), message.get_srcComponent())
    return _Request(sender, sequence, session, opcode, size, offset, payload[HEADER.size :])


def _path(request: _Request) -> str:
    """Return the absolute path in a request; what is not ASCII is no path."""
    name = request.data[: request.size].partition(b"\0")[0]
    return "/" + name.decode("ascii", "replace").lstrip("/")


def _answer(
    request: _Request,
    opcode: Opcode,
    data: bytes,
    *,
    sequence: int | None = None,
    offset: int | None = None,
    complete: bool = False,
) -> Any:
    number = request.sequence + 1 if sequence is None else sequence
    at = request.offset if offset is None else offset
    head = HEADER.pack(number % 65536, request.session, opcode, len(data), request.opcode, complete, at)
    payload = (head + data).ljust(PAYLOAD_BYTES, b"\0")
    return mavlink.MAVLink_file_transfer_protocol_message(0, *request.sender, payload)
