"""Reader of the older capture format, pcap: one link type and one clock for all packets.

A header of 24 bytes, then records of time, captured length and length on the network (IETF
draft-ietf-opsawg-pcap). The first word tells the byte order, and whether times count microseconds or
nanoseconds. Nothing in a record shows where the next begins if it is damaged, so a record counts where
another follows it or the file ends.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import partial
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.captures.damaged_parts import DamagedParts, next_record
from companion.desk.replay.captures.pcapng import Frame

HEADER_BYTES, RECORD_BYTES = 24, 16
# First word: ticks per second, and bytes of a record's head; the third is Kuznetsov's patched libpcap.
FORMS = {0xA1B2C3D4: (10**6, 16), 0xA1B23C4D: (10**9, 16), 0xA1B2CD34: (10**6, 24)}
LINK_BITS = 0xFFFF  # of the word with the link type; the others tell of checksums
MOST_BYTES = 1 << 18  # of a frame: libpcap's own limit
NEAR_S = 86_400  # a record behind a damaged part is of the same day
CHAIN = 3  # records in a row that end the search where no time before them is known


class PcapRecords:
    """Frames of an opened pcap file.

    Parameters
    ----------
    damage
        Takes the parts that cannot be read.

    Raises
    ------
    ValueError
        It is no pcap file.
    """

    def __init__(self, file: BinaryIO, damage: DamagedParts) -> None:
        self._file, self._damage = file, damage
        head = file.read(HEADER_BYTES)
        if len(head) < HEADER_BYTES:
            raise ValueError("it is shorter than a header")
        order = next((order for order in "<>" if struct.unpack(order + "I", head[:4])[0] in FORMS), "")
        if not order:
            raise ValueError("it has another first word")
        magic, _, _, _, _, snap, link = struct.unpack(order + "IHHiIII", head)
        self._order = order
        self._per_second, self._head_bytes = FORMS[magic]
        self._link = link & LINK_BITS
        self._most = max(MOST_BYTES, snap if snap < 1 << 24 else 0)
        self._words = struct.Struct(order + "IIII")

    def __iter__(self) -> Iterator[Frame]:
        at, last_s = HEADER_BYTES, None
        self._file.seek(at)
        head = self._file.read(self._head_bytes)
        while head:
            told = self._told(head)
            data = b"" if told is None else self._file.read(told[2] + self._head_bytes)
            if told is None or len(data) < told[2]:
                ends = told is not None or len(head) < self._head_bytes
                why = "it ends within a packet" if ends else "it has a damaged record"
                at, head = self._next(at, at + 1, last_s, why)
                continue
            seconds, ticks, captured, length = told
            last_s = seconds
            begin, at, head = at, at + self._head_bytes + captured, data[captured:]
            if len(head) == self._head_bytes and self._told(head) is None:
                # Either the next record is damaged, or the length of this one is wrong and hides the next.
                after = at
                at, head = self._next(begin, begin + 1, last_s, "it has a damaged record", after)
                if at < after:
                    continue
            at_ns = seconds * 1_000_000_000 + ticks * (1_000_000_000 // self._per_second)
            yield Frame(self._link, at_ns, data[:captured], length)

    def _told(self, head: bytes) -> tuple[int, int, int, int] | None:
        """Return seconds, ticks, captured and whole length by a record's head; None if it cannot be one."""
        if len(head) < self._head_bytes:
            return None
        seconds, ticks, captured, length = self._words.unpack_from(head)
        plausible = ticks <= self._per_second and max(captured, length) <= self._most
        return (seconds, ticks, captured, length) if plausible and (seconds or captured) else None

    def _next(
        self, damaged: int, begin: int, last_s: int | None, why: str, after: int | None = None
    ) -> tuple[int, bytes]:
        """Return offset and head of the next whole record from `begin` on, and note the part before it.

        That part begins at `damaged`, or at `after` if the record lies behind that.
        """

        def looks(words: NDArray[np.uint32]) -> NDArray[np.bool_]:
            seconds, ticks, captured, length = words.T
            found = (ticks <= self._per_second) & (captured > 0) & (captured <= self._most)
            found &= (length <= self._most) & (length >= captured)
            if last_s is not None:
                found &= np.abs(seconds.astype(np.int64) - last_s) <= NEAR_S
            return np.asarray(found)

        at = next_record(
            self._file,
            begin,
            RECORD_BYTES // 4,
            self._order,
            looks,
            partial(self._is_whole, 1 if last_s is not None else CHAIN),
        )
        size = self._file.seek(0, 2)
        end = size if at is None else at
        self._damage.add(damaged if after is None or end < after else after, end, why)
        self._file.seek(end)
        return end, self._file.read(self._head_bytes)

    def _is_whole(self, count: int, at: int) -> bool:
        """Return whether so many whole records of one day, or all up to the file's end, begin here."""
        first_s: int | None = None
        for _ in range(count):
            self._file.seek(at)
            head = self._file.read(self._head_bytes)
            if not head and first_s is not None:
                return True
            told = self._told(head)
            if told is None or abs(told[0] - (first_s or told[0])) > NEAR_S:
                return False
            first_s = first_s or told[0]
            at += self._head_bytes + told[2]
        return at <= self._file.seek(0, 2)
