"""Reader of pcapng files; each packet has the link type and the clock of its own interface.

A file is one or more sections of blocks: type, length, body, and the length repeated, in the byte order of
the section's header. Interface descriptions precede the packets that refer to them; `if_tsresol` is the
resolution of their times, `if_tsoffset` their epoch in seconds (IETF draft-ietf-opsawg-pcapng).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.captures.damaged_parts import DamagedParts, next_record

SECTION, INTERFACE, OLD_PACKET, SIMPLE_PACKET, PACKET = 0x0A0D0D0A, 1, 2, 3, 6
# Beside them: names, statistics, journal entries, secrets, and the makers' own blocks.
TYPES = np.array(
    [SECTION, INTERFACE, OLD_PACKET, SIMPLE_PACKET, 4, 5, PACKET, 9, 10, 0xBAD, 0x40000BAD], np.uint32
)
MAGIC = SECTION.to_bytes(4, "big")  # the same in either byte order
ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
END, RESOLUTION, OFFSET = 0, 9, 14  # options of an interface
MOST_BLOCK = 1 << 24  # bytes
LEAST_BLOCK = 12
MICROSECONDS = 6


class DamagedError(ValueError):
    """A contradictory block, or one that the file's end cuts."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Frame of a capture. link: type of its head. at_ns: since 1970. length: on the network, in bytes."""

    link: int
    at_ns: int
    data: bytes
    length: int


@dataclass(frozen=True, slots=True)
class Interface:
    """Capture interface. link: type of its frames. per_second: clock ticks. offset_s: epoch since 1970."""

    link: int
    per_second: int
    offset_s: int

    def since_1970_ns(self, count: int) -> int:
        """Convert a time of this interface to ns since 1970."""
        return self.offset_s * 1_000_000_000 + count * 1_000_000_000 // self.per_second


def packets(file: BinaryIO, damage: DamagedParts) -> Iterator[Frame]:
    """Yield every packet that has a time; `damage` takes the parts that cannot be read."""
    order, interfaces, at = "", list[Interface](), 0
    while head := file.read(8):
        try:
            order, kind, body = _block(file, head, order)
        except DamagedError as error:
            found = _next_block(file, at + 1, order)
            end = file.seek(0, 2) if found is None else found
            damage.add(at, end, str(error))
            at = file.seek(end)
            continue
        begin, at = at, file.tell()
        try:
            if kind == SECTION:
                interfaces.clear()
            elif kind == INTERFACE:
                interfaces.append(_interface(body, order))
            elif kind in (PACKET, OLD_PACKET):
                yield _packet(body, kind, order, interfaces)
        except (DamagedError, struct.error):
            damage.add(begin, at, "a packet is of no interface, or longer than its block")


def _packet(body: bytes, kind: int, order: str, interfaces: list[Interface]) -> Frame:
    form = order + ("IIIII" if kind == PACKET else "HHIIII")
    number, *rest = struct.unpack_from(form, body)
    high, low, captured, length = rest[-4:]
    begin = struct.calcsize(form)
    if number >= len(interfaces) or begin + captured > len(body):
        raise DamagedError
    one = interfaces[number]
    return Frame(one.link, one.since_1970_ns(high << 32 | low), body[begin : begin + captured], length)


def _block(file: BinaryIO, head: bytes, order: str) -> tuple[str, int, bytes]:
    """Return byte order, type and body of the block with these first eight bytes."""
    if head[:4] == MAGIC:
        magic = file.read(4)
        if magic not in ORDERS:
            raise DamagedError("a section has no byte order")
        head, order = head + magic, ORDERS[magic]
    if not order:
        raise DamagedError("it does not begin with a section")
    if len(head) < 8:
        raise DamagedError("it ends within a block")
    kind, length = struct.unpack_from(order + "II", head)
    if not max(LEAST_BLOCK, len(head) + 4) <= length <= MOST_BLOCK or length % 4:
        raise DamagedError(f"a block has {length} bytes")
    body = file.read(length - len(head))
    if len(body) < length - len(head):
        raise DamagedError("it ends within a block")
    (repeated,) = struct.unpack(order + "I", body[-4:])
    if repeated != length:
        raise DamagedError(f"a block has {length} bytes by its first length, {repeated} by its last")
    return order, kind, body[:-4]


def _next_block(file: BinaryIO, begin: int, order: str) -> int | None:
    """Return the offset of the next whole block of a known type, None if there is none."""

    def looks(words: NDArray[np.uint32]) -> NDArray[np.bool_]:
        kind, length = words.T
        sized = (length >= LEAST_BLOCK) & (length <= MOST_BLOCK) & (length % 4 == 0)
        return np.asarray(np.isin(kind, TYPES) & (sized | (kind == SECTION)))

    def is_whole(at: int) -> bool:
        file.seek(at)
        try:
            _block(file, file.read(8), order)
        except DamagedError:
            return False
        return True

    return next_record(file, begin, 2, order or "<", looks, is_whole)


def _interface(body: bytes, order: str) -> Interface:
    """Parse the body of an interface description."""
    (link,) = struct.unpack_from(order + "H", body)
    per_second, offset_s, at = 10**MICROSECONDS, 0, 8
    while at + 4 <= len(body):
        code, length = struct.unpack_from(order + "HH", body, at)
        value = body[at + 4 : at + 4 + length]
        if code == END:
            break
        if code == RESOLUTION and len(value) == 1:
            per_second = (2 if value[0] & 0x80 else 10) ** (value[0] & 0x7F)
        elif code == OFFSET and len(value) == 8:
            (offset_s,) = struct.unpack(order + "q", value)
        at += 4 + length + -length % 4
    return Interface(link, per_second, offset_s)
