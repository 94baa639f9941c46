"""UDP datagrams of a capture (pcap or pcapng), with IPv4 fragments reassembled."""

from __future__ import annotations

from collections import OrderedDict
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
RAW = frozenset({12, 14, 101, 228, 229})  # link types that begin with IP
LOOPBACK = frozenset({0, 108})  # after four bytes of address family


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
        try:
            with path.open("rb") as file:
                self._next_generation = file.read(len(pcapng.MAGIC)) == pcapng.MAGIC
                file.seek(0)
                if not self._next_generation:
                    PcapRecords(file, DamagedParts())
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from None
        except ValueError:
            raise UsageError(f"{path}: it is no pcap or pcapng file") from None

    def datagrams(self) -> Iterator[Datagram]:
        """Yield the UDP datagrams in the order of the file."""
        pieces, damage = _Fragments(), DamagedParts()
        self.other = self.bad = self.snapped = self.snapped_bytes = 0
        with self._path.open("rb") as file:
            frames = pcapng.packets(file, damage) if self._next_generation else PcapRecords(file, damage)
            for frame in frames:
                is_cut = len(frame.data) < frame.length
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


def _network(link: int, frame: bytes) -> Any:
    """Return the IP packet of a frame; None if there is none."""
    if link == dpkt.pcap.DLT_EN10MB:
        return dpkt.ethernet.Ethernet(frame).data
    if link == dpkt.pcap.DLT_LINUX_SLL:
        return dpkt.sll.SLL(frame).data
    if link == dpkt.pcap.DLT_LINUX_SLL2:
        return dpkt.sll2.SLL2(frame).data
    if link in LOOPBACK:
        frame = frame[4:]
    elif link not in RAW:
        return None
    return dpkt.ip6.IP6(frame) if frame[0] >> 4 == 6 else dpkt.ip.IP(frame)


class _Fragments:
    """Reassembly of IPv4 fragments (RFC 791)."""

    def __init__(self) -> None:
        self._waiting: OrderedDict[tuple[bytes, bytes, int], dict[int, tuple[bytes, bool]]] = OrderedDict()

    def add(self, packet: Any) -> tuple[str, bytes] | None:
        """Return sender and data of the UDP datagram that this packet is or completes; else None.

        Raises
        ------
        CutDatagramError
            It is cut.
        """
        if isinstance(packet, dpkt.ip6.IP6):
            return (packet.src.hex(), _data(packet.data)) if packet.nxt == UDP else None
        if not isinstance(packet, dpkt.ip.IP) or packet.p != UDP:
            return None
        host = ".".join(map(str, packet.src))
        if not (packet.mf or packet.offset):
            return host, _data(packet.data)
        part = bytes(packet.data)
        if packet.len > 4 * packet.hl + len(part):
            raise CutDatagramError
        key = packet.src, packet.dst, packet.id
        parts = self._waiting.setdefault(key, {})
        parts[packet.offset * 8] = part, bool(packet.mf)
        whole = _whole(parts)
        if whole is not None:
            del self._waiting[key]
            return host, _data(dpkt.udp.UDP(whole))
        while len(self._waiting) > UNFINISHED:
            self._waiting.popitem(last=False)
        return None


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
