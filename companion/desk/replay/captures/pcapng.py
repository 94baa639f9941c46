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

SECTION, INTERFACE, OLD_PACKET, SIMPLE_PACKET, PACKET = 0x0A0D0D0A, 1, 2, 3, 6
MAGIC = SECTION.to_bytes(4, "big")  # the same in either byte order
ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
END, RESOLUTION, OFFSET = 0, 9, 14  # options of an interface
MOST_BLOCK = 1 << 24  # bytes
MICROSECONDS = 6


class DamagedError(ValueError):
    """Contradictory blocks, or a file that ends within one."""


@dataclass(frozen=True, slots=True)
class Interface:
    """Capture interface. link: type of its frames. per_second: clock ticks. offset_s: epoch since 1970."""

    link: int
    per_second: int
    offset_s: int

    def since_1970_ns(self, count: int) -> int:
        """Convert a time of this interface to ns since 1970."""
        return self.offset_s * 1_000_000_000 + count * 1_000_000_000 // self.per_second


def packets(file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
    """Yield link type, time since 1970 (ns) and frame of every packet that has a time.

    Raises
    ------
    DamagedError
        The rest cannot be read.
    """
    order, interfaces = "", list[Interface]()
    try:
        while head := file.read(8):
            order, kind, body = _block(file, head, order)
            if kind == SECTION:
                interfaces.clear()
            elif kind == INTERFACE:
                interfaces.append(_interface(body, order))
            elif kind in (PACKET, OLD_PACKET):
                form = order + ("IIIII" if kind == PACKET else "HHIIII")
                number, *rest = struct.unpack_from(form, body)
                high, low, captured = rest[-4:-1]
                begin = struct.calcsize(form)
                if number >= len(interfaces) or begin + captured > len(body):
                    raise DamagedError("a packet is of no interface, or longer than its block")
                one = interfaces[number]
                yield one.link, one.since_1970_ns(high << 32 | low), body[begin : begin + captured]
    except struct.error as error:
        raise DamagedError(f"it ends within a block: {error}") from None


def _block(file: BinaryIO, head: bytes, order: str) -> tuple[str, int, bytes]:
    """Return byte order, type and body of the block with these first eight bytes."""
    if head[:4] == MAGIC:
        magic = file.read(4)
        if magic not in ORDERS:
            raise DamagedError("a section has no byte order")
        head, order = head + magic, ORDERS[magic]
    if not order:
        raise DamagedError("it does not begin with a section")
    kind, length = struct.unpack_from(order + "II", head)
    if not len(head) + 4 <= length <= MOST_BLOCK or length % 4:
        raise DamagedError(f"a block has {length} bytes")
    body = file.read(length - len(head))
    if len(body) < length - len(head):
        raise DamagedError("it ends within a block")
    return order, kind, body[:-4]


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
