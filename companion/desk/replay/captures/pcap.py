"""UDP datagrams of a capture (pcap or pcapng), with fragments of IP reassembled."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dpkt

from companion.desk.replay.captures import pcapng
from companion.desk.replay.captures.damaged_parts import DamagedParts
from companion.desk.replay.captures.pcap_records import PcapRecords
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
            told = damage.sentence(file.seek(0, 2))
            self.cut = f"{self._path.name}: {told}" if told else ""


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
