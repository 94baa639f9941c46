"""UDP datagrams of a capture (pcap or pcapng), with IPv4 fragments reassembled."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import dpkt

from companion.desk.replay.captures import pcapng
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


class Capture:
    """A capture file.

    Attributes
    ----------
    cut
        Reason for the missing end, or empty; known once the file was read.
    other, bad
        Number of packets that are no UDP, and of unreadable ones.

    Raises
    ------
    UsageError
        It cannot be read or is no capture.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.cut = ""
        self.other = self.bad = 0
        try:
            with path.open("rb") as file:
                self._next_generation = file.read(len(pcapng.MAGIC)) == pcapng.MAGIC
                file.seek(0)
                if not self._next_generation:
                    dpkt.pcap.Reader(file)
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from None
        except (ValueError, dpkt.dpkt.Error):
            raise UsageError(f"{path}: it is no pcap or pcapng file") from None

    def datagrams(self) -> Iterator[Datagram]:
        """Yield the UDP datagrams in the order of the file."""
        pieces = _Fragments()
        self.other = self.bad = 0
        with self._path.open("rb") as file:
            for link, at_ns, frame in self._frames(file):
                try:
                    found = pieces.add(_network(link, frame))
                except Exception:  # dpkt passes on errors of any kind
                    self.bad += 1
                    continue
                if found is None:
                    self.other += 1
                else:
                    yield Datagram(at_ns, found[0], found[1])

    def _frames(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        """Yield link type, time since 1970 (ns) and bytes of every frame."""
        frames = pcapng.packets(file) if self._next_generation else _of_one_interface(file)
        while True:
            try:
                frame = next(frames)
            except StopIteration:
                return
            except Exception as error:  # dpkt raises errors of struct and its own
                self.cut = f"{self._path.name} is damaged or cut off: {error!r}"
                return
            yield frame


def _of_one_interface(file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
    """Yield the frames of the older format, whose header has one link type for all."""
    asked = _Asked(file)
    reader = dpkt.pcap.Reader(asked)
    link = reader.datalink()
    for at_s, frame in reader:
        if asked.short:
            raise pcapng.DamagedError("it ends within a packet")
        yield link, round(float(at_s) * 1e6) * 1000, bytes(frame)


class _Asked:
    """File that records whether its last read was short, which dpkt does not check."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.short = False

    def read(self, n: int) -> bytes:
        data = self._file.read(n)
        self.short = len(data) < n
        return data


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
        """Return sender and data of the UDP datagram that this packet is or completes; else None."""
        if isinstance(packet, dpkt.ip6.IP6):
            return (packet.src.hex(), bytes(packet.data.data)) if packet.nxt == UDP else None
        if not isinstance(packet, dpkt.ip.IP) or packet.p != UDP:
            return None
        host = ".".join(map(str, packet.src))
        if not (packet.mf or packet.offset):
            return host, bytes(packet.data.data)
        key = packet.src, packet.dst, packet.id
        parts = self._waiting.setdefault(key, {})
        parts[packet.offset * 8] = bytes(packet.data), bool(packet.mf)
        whole = _whole(parts)
        if whole is not None:
            del self._waiting[key]
            return host, bytes(dpkt.udp.UDP(whole).data)
        while len(self._waiting) > UNFINISHED:
            self._waiting.popitem(last=False)
        return None


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
