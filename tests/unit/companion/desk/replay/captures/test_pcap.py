"""Network captures: frames of every link type, fragments, and packets that are no datagrams."""

from __future__ import annotations

import bz2
import gzip
import lzma
import struct
from pathlib import Path
from typing import Any

import dpkt
import pytest

from companion.desk.replay.captures.pcap import UNFINISHED, Capture, Datagram
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay.flights import BEGIN_NS

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
    "Ethernet of a VLAN": (ETHERNET, bytes(12) + b"\x81\x00\x00\x05\x08\x00"),
    "Ethernet of a VLAN in another": (ETHERNET, bytes(12) + b"\x88\xa8\x00\x07\x81\x00\x00\x05\x08\x00"),
    "Linux cooked": (113, b"\x00\x00\x00\x01\x00\x06" + bytes(8) + b"\x08\x00"),
    "Linux cooked of a VLAN": (113, bytes(14) + b"\x81\x00\x00\x05\x08\x00"),
    "Linux cooked, second version": (276, b"\x08\x00" + bytes(18)),
    "Linux cooked, second version, of a VLAN": (276, b"\x81\x00" + bytes(18) + b"\x00\x05\x08\x00"),
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
    assert read.not_read == ["2 packets are of link type 147, which is not read: capture on Ethernet"]


def test_datagrams_of_ipv6_are_taken_and_its_other_packets_are_not(tmp_path: Path) -> None:
    read, found = capture(tmp_path / "a.pcap", RAW, ip6(udp(b"one")), ip6(bytes(20), kind=6))
    assert [d.data for d in found] == [b"one"]
    assert (read.other, read.bad) == (1, 0)


HOP_BY_HOP, FRAGMENT, OPTIONS = 0, 44, 60


@pytest.mark.parametrize("kind", [HOP_BY_HOP, OPTIONS])
def test_datagrams_behind_extensions_of_ipv6_are_taken(tmp_path: Path, kind: int) -> None:
    extension = bytes([17, 0, 1, 4, 0, 0, 0, 0])
    read, found = capture(tmp_path / "a.pcap", RAW, ip6(extension + udp(b"one"), kind))
    assert [d.data for d in found] == [b"one"]
    assert (read.other, read.bad) == (0, 0)


def test_fragments_of_ipv6_make_one_datagram(tmp_path: Path) -> None:
    whole = udp(b"a" * 40)
    parts = [(0, 1, whole[:16]), (2, 0, whole[16:])]
    frames = [ip6(struct.pack(">BxHI", 17, at << 3 | more, 7) + data, FRAGMENT) for at, more, data in parts]
    for order in (frames, frames[::-1]):
        _, found = capture(tmp_path / "a.pcap", RAW, *order)
        assert [d.data for d in found] == [b"a" * 40]


PACKED = {"gzip": gzip.compress(bytes(99)), "bzip2": bz2.compress(bytes(99)), "xz": lzma.compress(bytes(99))}


@pytest.mark.parametrize(("by", "content"), PACKED.items(), ids=PACKED)
def test_a_compressed_capture_is_named(tmp_path: Path, by: str, content: bytes) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=f"compressed by {by}.*unpack it"):
        Capture(path)


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


# ---- pcapng -----------------------------------------------------------------------------------------------

SECTION, INTERFACE, PACKET, SIMPLE, OLD = 0x0A0D0D0A, 1, 6, 3, 2
COOKED, LOOP = 113, 0
MICRO, NANO, BINARY = 6, 9, 0x80 | 20  # what times count: 10^-6 s, 10^-9 s, 2^-20 s


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    body += bytes(-len(body) % 4)
    length = struct.pack(order + "I", 12 + len(body))
    return struct.pack(order + "I", kind) + length + body + length


def section(order: str = "<") -> bytes:
    return block(SECTION, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(link: int, resolution: int | None, offset_s: int = 0, order: str = "<") -> bytes:
    body = struct.pack(order + "HHI", link, 0, 0)
    if resolution is not None:
        body += struct.pack(order + "HHB3x", 9, 1, resolution)
    if offset_s:
        body += struct.pack(order + "HHq", 14, 8, offset_s)
    return block(INTERFACE, body + struct.pack(order + "HH", 0, 0), order)


def packet(number: int, count: int, frame: bytes, order: str = "<", kind: int = PACKET) -> bytes:
    first = struct.pack(
        order + ("I" if kind == PACKET else "HH"), *([number] if kind == PACKET else [number, 0])
    )
    rest = struct.pack(order + "IIII", count >> 32, count % 2**32, len(frame), len(frame))
    return block(kind, first + rest + frame, order)


ETHERNET_HEAD, COOKED_HEAD, LOOP_HEAD = FRAMES["Ethernet"][1], FRAMES["Linux cooked"][1], b"\x02\0\0\0"
BEGIN_US = BEGIN_NS // 1000


def of_several_interfaces(order: str = "<") -> bytes:
    """Return five packets a millisecond apart, of interfaces that differ in link type and clock."""
    end = BEGIN_NS + 3_000_000
    return b"".join(
        [
            section(order),
            interface(ETHERNET, None, order=order),
            interface(COOKED, NANO, order=order),
            packet(0, BEGIN_US, ETHERNET_HEAD + ip(udp(b"one")), order),
            packet(1, BEGIN_NS + 1_000_000, COOKED_HEAD + ip(udp(b"two")), order),
            interface(RAW, MICRO, BEGIN_NS // 10**9, order),
            packet(2, 2000, ip(udp(b"three")), order),
            block(5, bytes(12), order),  # statistics of an interface
            block(SIMPLE, struct.pack(order + "I", 4) + bytes(4), order),  # has no time
            section(),
            interface(LOOP, BINARY),
            packet(0, (end * 2**20 + 10**9 - 1) // 10**9, LOOP_HEAD + ip(udp(b"four"))),
            packet(0, ((end + 1_000_000) * 2**20) // 10**9, LOOP_HEAD + ip(udp(b"five")), kind=OLD),
        ]
    )


@pytest.mark.parametrize("order", ["<", ">"])
def test_packets_are_read_by_link_type_and_clock_of_their_own_interface(tmp_path: Path, order: str) -> None:
    path = tmp_path / "a.pcapng"
    path.write_bytes(of_several_interfaces(order))
    read = Capture(path)
    found = list(read.datagrams())
    assert [d.data for d in found] == [b"one", b"two", b"three", b"four", b"five"]
    times = [d.at_ns - BEGIN_NS for d in found]
    assert times[:3] == [0, 1_000_000, 2_000_000]
    assert times[3:] == pytest.approx([3_000_000, 4_000_000], abs=1000)
    assert (read.other, read.bad, read.cut) == (0, 0, "")


def test_a_pcapng_file_that_is_cut_off_gives_what_is_before(tmp_path: Path) -> None:
    path, whole = tmp_path / "a.pcapng", of_several_interfaces()
    for length in range(len(section()), len(whole), 7):
        path.write_bytes(whole[:length])
        read = Capture(path)
        data = [d.data for d in read.datagrams()]
        assert data == [b"one", b"two", b"three", b"four", b"five"][: len(data)]
    assert "ends within a block" in read.cut


def test_a_capture_that_is_cut_off_gives_the_whole_packets_before_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    sent = [b"one", b"two", b"three"]
    capture(path, RAW, *(ip(udp(data)) for data in sent))
    whole = path.read_bytes()
    ends = [24 + sum(16 + 28 + len(data) for data in sent[:n]) for n in range(4)]
    for length in range(24, len(whole) + 1):
        path.write_bytes(whole[:length])
        read = Capture(path)
        n = sum(end <= length for end in ends) - 1
        assert [d.data for d in read.datagrams()] == sent[:n]
        assert bool(read.cut) == (length not in ends)


DAMAGED = {
    "of no interface": (packet(7, BEGIN_US, b""), "of no interface"),
    "longer than its block": (
        block(PACKET, struct.pack("<IIIII", 0, 0, 0, 99, 99)),
        "longer than its block",
    ),
    "length": (struct.pack("<III", PACKET, 2**31, 0), "a block has 2147483648 bytes"),
    "lengths that differ": (packet(0, BEGIN_US, b"one")[:-4] + struct.pack("<I", 44), "by its last"),
    "byte order": (struct.pack("<III", SECTION, 28, 0), "no byte order"),
    "zeros": (bytes(4096), "a block has 0 bytes"),
    "noise": (bytes(range(1, 256)) * 9, "a block has"),
    "cut block": (packet(0, BEGIN_US, bytes(99))[:50], "a block has"),
}


@pytest.mark.parametrize(("damaged", "says"), DAMAGED.values(), ids=DAMAGED)
def test_what_is_whole_around_a_damaged_block_is_read_and_the_loss_told(
    tmp_path: Path, damaged: bytes, says: str
) -> None:
    path = tmp_path / "a.pcapng"
    good = [packet(0, BEGIN_US + 1000 * k, ETHERNET_HEAD + ip(udp(b"%d" % k))) for k in range(4)]
    path.write_bytes(section() + interface(ETHERNET, MICRO) + good[0] + good[1] + damaged + good[2] + good[3])
    read = Capture(path)
    assert [d.data for d in read.datagrams()] == [b"0", b"1", b"2", b"3"]
    assert says in read.cut
    assert f"{len(damaged)} of its {path.stat().st_size} bytes are left out" in read.cut


def old_record(number: int, frame: bytes, head: str = "<IIII", scale: int = 1) -> bytes:
    at_us = BEGIN_US + 1000 * number
    at = at_us // 10**6, at_us % 10**6 * scale
    return struct.pack(head, *at, len(frame), len(frame)) + frame


OLD_HEADER = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, RAW)
SENT = [b"%d" % k * 40 for k in range(8)]
OLD_RECORDS = [old_record(k, ip(udp(data))) for k, data in enumerate(SENT)]


def altered(record: bytes, at: int, form: str, value: int) -> bytes:
    return record[:at] + struct.pack(form, value) + record[at + struct.calcsize(form) :]


BROKEN = {
    "zeros": bytes(len(OLD_RECORDS[3])),
    "many zeros": bytes(5000),
    "noise": bytes(range(256)) * 9,
    "half a record": OLD_RECORDS[3][:60],
    "cut off at its head": OLD_RECORDS[3][30:],
    "a length beyond the file": altered(OLD_RECORDS[3], 8, "<I", 200_000),
    "a length beyond all": altered(OLD_RECORDS[3], 8, "<I", 2**31),
    "too short a length": altered(OLD_RECORDS[3], 8, "<I", 70),
    "too long a length": altered(OLD_RECORDS[3], 8, "<I", 170),
    "ticks of no second": altered(OLD_RECORDS[3], 4, "<I", 2**30),
}


@pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN)
def test_a_broken_record_costs_itself_alone_and_is_told(tmp_path: Path, broken: bytes) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(OLD_HEADER + b"".join([*OLD_RECORDS[:3], broken, *OLD_RECORDS[4:]]))
    read = Capture(path)
    found = [d.data for d in read.datagrams()]
    assert [data for data in found if data != SENT[3]] == SENT[:3] + SENT[4:]
    assert "damaged in one place" in read.cut
    assert read.cut.startswith("a.pcap: ")


def test_several_broken_records_and_a_cut_end_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    records = [
        *OLD_RECORDS[:2],
        bytes(900),
        *OLD_RECORDS[2:4],
        bytes(700),
        *OLD_RECORDS[4:7],
        OLD_RECORDS[7][:50],
    ]
    path.write_bytes(OLD_HEADER + b"".join(records))
    read = Capture(path)
    assert [d.data for d in read.datagrams()] == SENT[:7]
    assert "in 3 places, the first at byte" in read.cut
    assert "1650 of its" in read.cut


def test_the_times_of_a_clock_that_is_set_in_the_flight_are_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    early = [altered(record, 0, "<I", 95) for record in OLD_RECORDS[:4]]
    path.write_bytes(OLD_HEADER + b"".join([*early, *OLD_RECORDS[4:]]))
    read = Capture(path)
    assert [d.data for d in read.datagrams()] == SENT
    assert not read.cut


FORMS = {
    "big endian": (struct.pack(">IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, RAW), ">IIII", 1),
    "nanoseconds": (struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, RAW), "<IIII", 1000),
    "Kuznetsov's": (struct.pack("<IHHiIII", 0xA1B2CD34, 2, 4, 0, 0, 65535, RAW), "<IIII8x", 1),
    "with checksums": (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 0x28000000 | RAW), "<IIII", 1),
    "no snap length": (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 0, RAW), "<IIII", 1),
}


@pytest.mark.parametrize(("header", "head", "scale"), FORMS.values(), ids=FORMS)
def test_every_form_of_the_old_header_is_read(tmp_path: Path, header: bytes, head: str, scale: int) -> None:
    path = tmp_path / "a.pcap"
    records = [old_record(k, ip(udp(data)), head, scale) for k, data in enumerate(SENT)]
    path.write_bytes(header + b"".join(records))
    read = Capture(path)
    found = list(read.datagrams())
    assert [d.data for d in found] == SENT
    assert [d.at_ns - BEGIN_NS for d in found] == [1_000_000 * k for k in range(8)]
    assert not read.cut


@pytest.mark.parametrize("kept", [1000, 96, 60, 40, 32])
@pytest.mark.parametrize("name", ["a.pcap", "a.pcapng"])
def test_datagrams_cut_by_the_snap_length_are_counted_and_not_given(
    tmp_path: Path, name: str, kept: int
) -> None:
    frame, whole = ETHERNET_HEAD + ip(udp(bytes(1400))), ETHERNET_HEAD + ip(udp(b"one"))
    path = tmp_path / name
    if name == "a.pcap":
        cut = struct.pack("<IIII", BEGIN_US // 10**6, 0, kept, len(frame)) + frame[:kept]
        path.write_bytes(altered(OLD_HEADER, 20, "<I", ETHERNET) + old_record(0, whole) + cut)
    else:
        at = struct.pack("<III", 0, BEGIN_US >> 32, BEGIN_US % 2**32)
        body = at + struct.pack("<II", kept, len(frame)) + frame[:kept]
        good = packet(0, BEGIN_US, whole)
        path.write_bytes(section() + interface(ETHERNET, MICRO) + good + block(PACKET, body))
    read = Capture(path)
    assert [d.data for d in read.datagrams()] == [b"one"]
    assert (read.snapped, read.snapped_bytes, read.bad, read.other, read.cut) == (1, kept, 0, 0, "")


def test_padding_cut_off_by_the_snap_length_is_no_loss(tmp_path: Path) -> None:
    frame = ETHERNET_HEAD + ip(udp(b"one"))
    path = tmp_path / "a.pcap"
    cut = struct.pack("<IIII", BEGIN_US // 10**6, 0, len(frame), 60) + frame
    path.write_bytes(altered(OLD_HEADER, 20, "<I", ETHERNET) + cut)
    read = Capture(path)
    assert [d.data for d in read.datagrams()] == [b"one"]
    assert read.snapped == 0


def test_padding_behind_a_datagram_is_none_of_its_data(tmp_path: Path) -> None:
    datagram = bytes(dpkt.udp.UDP(sport=1, dport=2, data=b"one" + bytes(20), ulen=11))
    read, found = capture(tmp_path / "a.pcap", RAW, ip(datagram))
    assert [d.data for d in found] == [b"one"]
    assert read.bad == 0
