"""Captures of the network: frames of every kind of link, fragments, and what is no datagram."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import dpkt
import pytest

from companion.replay.pcap import UNFINISHED, Capture, Datagram
from tests.unit.companion.replay.flights import BEGIN_NS

SENDER = "10.0.0.1"
ETHERNET, RAW, USER = 1, 101, 147


def udp(data: bytes) -> bytes:
    return bytes(dpkt.udp.UDP(sport=56300, dport=56301, data=data, ulen=8 + len(data)))


def ip(payload: bytes, **fields: Any) -> bytes:
    """Return an IPv4 packet; fields: id, mf, and offset in eighths of the bytes before it."""
    packet = dpkt.ip.IP(src=bytes([10, 0, 0, 1]), dst=bytes([10, 0, 0, 2]), p=17, data=payload)
    for name, value in fields.items():
        setattr(packet, name, value)
    packet.len = 20 + len(payload)
    return bytes(packet)


def ip6(payload: bytes, kind: int = 17) -> bytes:
    host = bytes(15) + b"\x01"
    return bytes(dpkt.ip6.IP6(src=host, dst=host, nxt=kind, plen=len(payload), hlim=64, data=payload))


def capture(path: Path, link: int, *frames: bytes) -> tuple[Capture, list[Datagram]]:
    """Write frames a millisecond apart and read them back."""
    with path.open("wb") as file:
        writer = dpkt.pcap.Writer(file, linktype=link)
        for k, frame in enumerate(frames):
            writer.writepkt(frame, BEGIN_NS * 1e-9 + 1e-3 * k)
    read = Capture(path)
    return read, list(read.datagrams())


FRAMES = {
    "Ethernet": (ETHERNET, bytes(12) + b"\x08\x00"),
    "Linux cooked": (113, b"\x00\x00\x00\x01\x00\x06" + bytes(8) + b"\x08\x00"),
    "Linux cooked, second version": (276, b"\x08\x00" + bytes(18)),
    "loopback of BSD": (0, b"\x02\x00\x00\x00"),
    "loopback of OpenBSD": (108, b"\x00\x00\x00\x02"),
    "raw IP": (RAW, b""),
    "raw IPv4": (228, b""),
}


@pytest.mark.parametrize(("link", "head"), FRAMES.values(), ids=FRAMES)
def test_datagrams_are_found_whatever_network_they_were_captured_on(
    tmp_path: Path, link: int, head: bytes
) -> None:
    read, found = capture(tmp_path / "a.pcap", link, head + ip(udp(b"one")), head + ip(udp(b"two")))
    assert [(d.host, d.data) for d in found] == [(SENDER, b"one"), (SENDER, b"two")]
    assert found[1].at_ns - found[0].at_ns == pytest.approx(1_000_000, abs=1000)
    assert (read.other, read.bad, read.cut) == (0, 0, "")


def test_packets_of_an_unknown_kind_of_link_are_counted_as_others(tmp_path: Path) -> None:
    read, found = capture(tmp_path / "a.pcap", USER, ip(udp(b"one")), b"")
    assert not found
    assert (read.other, read.bad) == (2, 0)


def test_datagrams_of_ipv6_are_taken_and_its_other_packets_are_not(tmp_path: Path) -> None:
    read, found = capture(tmp_path / "a.pcap", RAW, ip6(udp(b"one")), ip6(bytes(20), kind=6))
    assert [d.data for d in found] == [b"one"]
    assert (read.other, read.bad) == (1, 0)


def test_frames_that_end_too_early_are_counted_as_bad(tmp_path: Path) -> None:
    read, found = capture(tmp_path / "a.pcap", RAW, b"", b"\x45\x00", ip(udp(b"one")))
    assert [d.data for d in found] == [b"one"]
    assert (read.other, read.bad) == (0, 2)


def halves(number: int, data: bytes) -> tuple[bytes, bytes]:
    whole = udp(data)
    return ip(whole[:16], id=number, mf=1), ip(whole[16:], id=number, offset=2)


def test_fragments_in_any_order_make_one_datagram(tmp_path: Path) -> None:
    first, last = halves(7, b"a" * 40)
    _, found = capture(tmp_path / "a.pcap", RAW, last, *halves(8, b"b" * 40), first)
    assert [d.data for d in found] == [b"b" * 40, b"a" * 40]


def test_of_fragments_whose_rest_never_comes_the_oldest_are_given_up(tmp_path: Path) -> None:
    pairs = [halves(number, b"%04d" % number * 10) for number in range(UNFINISHED + 1)]
    begun = [first for first, _ in pairs]
    _, found = capture(tmp_path / "a.pcap", RAW, *begun, pairs[1][1], pairs[0][1])
    assert [d.data for d in found] == [b"0001" * 10]


def test_an_empty_fragment_that_promises_more_completes_nothing(tmp_path: Path) -> None:
    read, found = capture(tmp_path / "a.pcap", RAW, ip(b"", id=1, mf=1), ip(b"", id=1, mf=1))
    assert not found
    assert read.other == 2
