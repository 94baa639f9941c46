"""UDP datagrams of a capture (pcap or pcapng), with fragments of IP reassembled."""

from __future__ import annotations

import struct
from collections import Counter, OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import dpkt
import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.captures import pcapng
from companion.desk.replay.captures.damaged_parts import DamagedParts, next_record
from companion.desk.replay.captures.pcapng import Frame
from companion.runtime.errors import UsageError

UDP = 17
UNFINISHED = 64  # incomplete datagrams kept at most
FRAGMENT, IPV6_BYTES = 44, 16  # extension, and bytes of an address
RAW = frozenset({12, 14, 101, 228, 229})  # link types that begin with IP
LOOPBACK = frozenset({0, 108})  # after four bytes of address family
# Place of the EtherType, and size of the head, by link type: Ethernet, Linux cooked of both versions.
HEADS = {1: (12, 14), 113: (14, 16), 276: (0, 20)}
VLAN = frozenset({0x8100, 0x88A8, 0x9100, 0x9200})  # EtherTypes of a tag of four bytes
IPV4, IPV6 = 0x0800, 0x86DD
PACKED = {
    b"\x1f\x8b": "gzip (gunzip)",
    b"\x28\xb5\x2f\xfd": "Zstandard (unzstd)",
    b"\xfd7zXZ": "xz (unxz)",
    b"BZh": "bzip2 (bunzip2)",
    b"\x04\x22\x4d\x18": "LZ4 (unlz4)",
    b"PK\x03\x04": "zip (unzip)",
}

HEADER_BYTES, RECORD_BYTES = 24, 16
# First word: ticks per second, and bytes of a record's head; the third is Kuznetsov's patched libpcap.
FORMS = {0xA1B2C3D4: (10**6, 16), 0xA1B23C4D: (10**9, 16), 0xA1B2CD34: (10**6, 24)}
LINK_BITS = 0xFFFF  # of the word with the link type; the other bits describe checksums
MOST_BYTES = 1 << 18  # of a frame: libpcap's own limit
NEAR_S = 86_400  # a record behind a damaged part is of the same day
CHAIN = 3  # records in a row that end the search where no time before them is known


@dataclass(frozen=True, slots=True)
class Datagram:
    """UDP datagram. at_ns: capture time since 1970. host: address of the sender."""

    at_ns: int
    host: str
    data: bytes


class CutDatagramError(ValueError):
    """A datagram that is shorter than it says."""


class Capture:
    """A capture file.

    Attributes
    ----------
    cut
        Parts of the file that cannot be read, empty where all can; known once the file was read.
    other, bad
        Number of packets that are no UDP, and of unreadable ones.
    snapped, snapped_bytes
        Number of datagrams that the capture's snap length cut, and the bytes that it left of the longest.

    Raises
    ------
    UsageError
        It cannot be read or is no capture.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.cut = ""
        self.other = self.bad = self.snapped = self.snapped_bytes = 0
        self._unread = Counter[int]()
        head = b""
        try:
            with path.open("rb") as file:
                head = file.read(max(map(len, PACKED)))
                self._next_generation = head.startswith(pcapng.MAGIC)
                file.seek(0)
                if not self._next_generation:
                    PcapRecords(file, DamagedParts())
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from None
        except ValueError:
            by = next((name for mark, name in PACKED.items() if head.startswith(mark)), "")
            what = f"compressed by {by}: unpack it" if by else "no pcap or pcapng file"
            raise UsageError(f"{path}: it is {what}") from None

    @property
    def not_read(self) -> list[str]:
        """Sentences on packets of link types that are not read."""
        return [
            f"{count} packets are of link type {link}, which is not read: capture on Ethernet"
            for link, count in sorted(self._unread.items())
        ]

    def datagrams(self) -> Iterator[Datagram]:
        """Yield the UDP datagrams in the order of the file."""
        pieces, damage = _Fragments(), DamagedParts()
        self.other = self.bad = self.snapped = self.snapped_bytes = 0
        self._unread.clear()
        with self._path.open("rb") as file:
            frames = pcapng.packets(file, damage) if self._next_generation else PcapRecords(file, damage)
            for frame in frames:
                is_cut = len(frame.data) < frame.length
                if not _is_known(frame.link):
                    self._unread[frame.link] += 1
                try:
                    packet = _network(frame.link, frame.data)
                    if is_cut and isinstance(packet, bytes):  # within the head of IP
                        raise CutDatagramError
                    found = pieces.add(packet)
                except Exception:  # dpkt passes on errors of any kind
                    self.snapped += is_cut
                    self.bad += not is_cut
                    if is_cut:
                        self.snapped_bytes = max(self.snapped_bytes, len(frame.data))
                    continue
                if found is None:
                    self.other += 1
                else:
                    yield Datagram(frame.at_ns, found[0], found[1])
            damage_text = damage.sentence(file.seek(0, 2))
            self.cut = f"{self._path.name}: {damage_text}" if damage_text else ""


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
            record = self._record_header(head)
            data = b"" if record is None else self._file.read(record[2] + self._head_bytes)
            if record is None or len(data) < record[2]:
                ends = record is not None or len(head) < self._head_bytes
                why = "it ends within a packet" if ends else "it has a damaged record"
                at, head = self._next(at, at + 1, last_s, why)
                continue
            seconds, ticks, captured, length = record
            last_s = seconds
            begin, at, head = at, at + self._head_bytes + captured, data[captured:]
            if len(head) == self._head_bytes and self._record_header(head) is None:
                # Either the next record is damaged, or the length of this one is wrong and hides the next.
                after = at
                at, head = self._next(begin, begin + 1, last_s, "it has a damaged record", after)
                if at < after:
                    continue
            at_ns = seconds * 1_000_000_000 + ticks * (1_000_000_000 // self._per_second)
            yield Frame(self._link, at_ns, data[:captured], length)

    def _record_header(self, head: bytes) -> tuple[int, int, int, int] | None:
        """Return seconds, ticks, captured and whole length by a record's head; None if implausible."""
        if len(head) < self._head_bytes:
            return None
        seconds, ticks, captured, length = self._words.unpack_from(head)
        plausible = ticks <= self._per_second and max(captured, length) <= self._most
        return (seconds, ticks, captured, length) if plausible and (seconds or captured) else None

    def _next(
        self, damaged: int, begin: int, last_s: int | None, why: str, after: int | None = None
    ) -> tuple[int, bytes]:
        """Return offset and head of the next whole record from `begin` on, and note the part before it.

        That part begins at `damaged`, or at `after` if the record is behind that.
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
        """Return True if `count` whole records of one day, or all up to the end, begin at an offset."""
        first_s: int | None = None
        for _ in range(count):
            self._file.seek(at)
            head = self._file.read(self._head_bytes)
            if not head and first_s is not None:
                return True
            record = self._record_header(head)
            if record is None or abs(record[0] - (first_s or record[0])) > NEAR_S:
                return False
            first_s = first_s or record[0]
            at += self._head_bytes + record[2]
        return at <= self._file.seek(0, 2)


def _is_known(link: int) -> bool:
    return link in HEADS or link in RAW or link in LOOPBACK


def _network(link: int, frame: bytes) -> Any:
    """Return the IP packet of a frame; None if there is none."""
    if link in HEADS:
        place, begin = HEADS[link]
        while (kind := int.from_bytes(frame[place : place + 2], "big")) in VLAN:
            place, begin = begin + 2, begin + 4
        if kind not in (IPV4, IPV6):
            return None
        frame = frame[begin:]
    elif link in LOOPBACK:
        frame = frame[4:]
    elif link not in RAW:
        return None
    return dpkt.ip6.IP6(frame) if frame[0] >> 4 == 6 else dpkt.ip.IP(frame)


class _Fragments:
    """Reassembly of the fragments of IPv4 (RFC 791) and IPv6 (RFC 8200)."""

    def __init__(self) -> None:
        self._waiting: OrderedDict[tuple[bytes, bytes, int], dict[int, tuple[bytes, bool]]] = OrderedDict()

    def add(self, packet: Any) -> tuple[str, bytes] | None:
        """Return sender and data of the UDP datagram that this packet is or completes; else None.

        Raises
        ------
        CutDatagramError
            It is cut.
        """
        if not isinstance(packet, (dpkt.ip.IP, dpkt.ip6.IP6)) or packet.p != UDP:
            return None
        host = packet.src.hex() if len(packet.src) == IPV6_BYTES else ".".join(map(str, packet.src))
        piece = _fragment(packet)
        if piece is None:
            return host, _data(packet.data)
        number, offset, more, is_cut = piece
        part = bytes(packet.data)
        if is_cut:
            raise CutDatagramError
        key = packet.src, packet.dst, number
        parts = self._waiting.setdefault(key, {})
        parts[offset * 8] = part, more
        whole = _whole(parts)
        if whole is not None:
            del self._waiting[key]
            return host, _data(dpkt.udp.UDP(whole))
        while len(self._waiting) > UNFINISHED:
            self._waiting.popitem(last=False)
        return None


def _fragment(packet: Any) -> tuple[int, int, bool, bool] | None:
    """Return number, offset (8 bytes), whether more follow, whether it is cut; None if it is no fragment."""
    if isinstance(packet, dpkt.ip.IP):
        is_cut = packet.len > 4 * packet.hl + len(bytes(packet.data))
        return (packet.id, packet.offset, bool(packet.mf), is_cut) if packet.mf or packet.offset else None
    head = packet.extension_hdrs.get(FRAGMENT)
    if head is None or not (head.m_flag or head.frag_off):
        return None
    before = sum(one.length for one in packet.all_extension_headers)
    return head.id, head.frag_off, bool(head.m_flag), packet.plen > before + len(bytes(packet.data))


def _data(datagram: Any) -> bytes:
    """Return the payload of a UDP datagram, by the length in its head."""
    data, length = bytes(datagram.data), datagram.ulen - 8
    if length > len(data):
        raise CutDatagramError
    return data[:length] if length > 0 else data


def _whole(parts: dict[int, tuple[bytes, bool]]) -> bytes | None:
    data = b""
    while len(data) in parts:
        part, more = parts[len(data)]
        data += part
        if not more:
            return data
        if not part:
            break
    return None
