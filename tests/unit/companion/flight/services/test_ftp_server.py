"""MAVLink FTP, request by request: what is served is read whole, nothing else is there to read or change."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.services.ftp_server import (
    BURST_INTERVAL_NS,
    BURST_PARTS,
    DATA_BYTES,
    MOST_OPEN,
    FtpServer,
    mavlink_crc32,
)
from tests.unit.companion.flight.link.messages import received

LONG = bytes(range(256)) * 4
FILES = {"/long.bin": LONG, "/short.txt": b"short", "/empty": b""}
ACK, NAK = 128, 129
TERMINATE, RESET, LIST, OPEN, READ, CRC, BURST = 1, 2, 3, 4, 5, 14, 15
INVALID_SIZE, INVALID_SESSION, END, UNKNOWN, PROTECTED, NOT_FOUND = 3, 4, 6, 7, 9, 10


class Reply:
    """Fields of an answer, decoded here from the protocol's description."""

    def __init__(self, message: Any) -> None:
        raw = bytes(message.payload)
        self.to = (message.target_system, message.target_component)
        self.sequence, self.session, self.opcode, size, self.asked, self.complete, _, self.offset = (
            struct.unpack_from("<HBBBBBBI", raw)
        )
        self.data = raw[12 : 12 + size]

    @property
    def fault(self) -> int:
        assert self.opcode == NAK
        assert len(self.data) == 1
        return self.data[0]


class Station:
    """A station that sends requests to a server of its own."""

    def __init__(self) -> None:
        self.server = FtpServer(FILES)
        self.sequence = 0

    def send(
        self,
        opcode: int,
        data: bytes = b"",
        *,
        size: int | None = None,
        offset: int = 0,
        session: int = 0,
        to: tuple[int, int] = (1, 191),
        sender: tuple[int, int] = (255, 190),
    ) -> list[Reply]:
        size = len(data) if size is None else size
        head = struct.pack("<HBBBBBBI", self.sequence, session, opcode, size, 0, 0, 0, offset)
        self.sequence += 2
        payload = (head + data).ljust(251, b"\0")
        message = received(mavlink.MAVLink_file_transfer_protocol_message(0, *to, payload), *sender)
        return [Reply(received(m)) for m in self.server.on_message(message, 1, 191)]

    def ask(self, opcode: int, data: bytes = b"", **fields: Any) -> Reply:
        (reply,) = self.send(opcode, data, **fields)
        assert (reply.sequence, reply.asked) == (self.sequence - 1, opcode)
        return reply

    def burst(self, begin_ns: int = 0) -> list[Reply]:
        times = range(begin_ns, begin_ns + 10**10, BURST_INTERVAL_NS)
        return [Reply(received(m)) for at in times for m in self.server.poll(at)]


def test_a_file_is_read_part_by_part_until_its_end() -> None:
    station = Station()
    opened = station.ask(OPEN, b"/long.bin")
    assert (opened.opcode, opened.to, struct.unpack("<I", opened.data)) == (ACK, (255, 190), (len(LONG),))
    read = b""
    while (reply := station.ask(READ, size=DATA_BYTES, offset=len(read))).opcode == ACK:
        assert reply.offset == len(read)
        read += reply.data
    assert read == LONG
    assert reply.fault == END
    assert station.server.refused == 0


@pytest.mark.parametrize("size", [80, DATA_BYTES, 0])
def test_a_burst_brings_the_rest_in_numbered_parts_ten_a_second(size: int) -> None:
    station = Station()
    station.ask(OPEN, b"long.bin\0", session=3)
    assert station.send(BURST, size=size, offset=100, session=3) == []
    parts = station.burst()
    assert b"".join(p.data for p in parts) == LONG[100:]
    assert [p.sequence for p in parts] == list(range(3, 3 + len(parts)))
    assert [p.offset for p in parts] == [100 + k * (size or DATA_BYTES) for k in range(len(parts))]
    assert [p.complete for p in parts] == [0] * (len(parts) - 1) + [1]
    assert {(p.opcode, p.asked, p.session) for p in parts} == {(ACK, BURST, 3)}
    assert station.ask(BURST, size=size, offset=len(LONG), session=3).fault == END


def test_a_burst_ends_before_the_station_gives_up_and_the_next_goes_on() -> None:
    station = Station()
    station.ask(OPEN, b"/long.bin")
    station.send(BURST, size=40)
    parts = station.burst()
    assert [len(p.data) for p in parts] == [40] * BURST_PARTS
    assert [p.complete for p in parts] == [0] * (BURST_PARTS - 1) + [1]
    station.send(BURST, size=40, offset=40 * BURST_PARTS)
    assert b"".join(p.data for p in parts + station.burst(10**12)) == LONG


def test_parts_of_a_burst_are_no_faster_than_the_interval_however_many_bursts_run() -> None:
    station = Station()
    for session in range(3):
        station.ask(OPEN, b"/long.bin", session=session)
        station.send(BURST, size=80, session=session)
    assert len(station.server.poll(0)) == 1
    assert station.server.poll(BURST_INTERVAL_NS - 1) == []
    parts = [Reply(received(m)) for k in range(1, 60) for m in station.server.poll(k * BURST_INTERVAL_NS)]
    assert [p.session for p in parts[:5]] == [1, 2, 0, 1, 2]
    assert sum(p.complete for p in parts) == 3


@pytest.mark.parametrize("opcode", [TERMINATE, RESET, OPEN])
def test_a_burst_ends_with_its_session(opcode: int) -> None:
    station = Station()
    station.ask(OPEN, b"/long.bin")
    station.send(BURST, size=80)
    station.ask(opcode, b"/long.bin")
    assert station.burst() == []


def test_a_burst_goes_on_while_a_lost_part_is_read_again_and_a_new_one_replaces_it() -> None:
    station = Station()
    station.ask(OPEN, b"/long.bin")
    station.send(BURST, size=100)
    assert station.ask(READ, size=80, offset=5).data == LONG[5:85]
    assert b"".join(p.data for p in station.burst()) == LONG
    station.send(BURST, size=100)
    station.send(BURST, size=100, offset=500)
    assert b"".join(p.data for p in station.burst(10**12)) == LONG[500:]


def test_the_folder_lists_every_file_with_its_size() -> None:
    station = Station()
    for folder in (b"/", b"", b"/\0"):
        assert station.ask(LIST, folder).data == b"Flong.bin\t1024\0Fshort.txt\t5\0Fempty\t0\0"
    assert station.ask(LIST, b"/", offset=2).data == b"Fempty\t0\0"
    assert station.ask(LIST, b"/", offset=3).fault == END
    assert station.ask(LIST, b"/etc").fault == NOT_FOUND


def test_a_long_list_is_read_in_parts() -> None:
    station = Station()
    names = [f"/{'x' * 60}{k}" for k in range(9)]
    station.server = FtpServer(dict.fromkeys(names, b""))
    listed: list[bytes] = []
    while (reply := station.ask(LIST, b"/", offset=len(listed))).opcode == ACK:
        assert reply.data.endswith(b"\0")
        listed += reply.data[:-1].split(b"\0")
    assert listed == [f"F{name[1:]}\t0".encode() for name in names]


@pytest.mark.parametrize(
    "path", [b"/etc/passwd", b"../long.bin", b"/./long.bin", b"/long.bin/", b"long", b"", b"/", b"\xff" * 200]
)
def test_what_is_not_served_is_not_found(path: bytes) -> None:
    station = Station()
    assert station.ask(OPEN, path).fault == station.ask(CRC, path).fault == NOT_FOUND
    assert station.ask(READ, size=1).fault == INVALID_SESSION


@pytest.mark.parametrize("opcode", range(6, 14))
def test_nothing_can_be_changed(opcode: int) -> None:
    station = Station()
    assert station.ask(opcode, b"/long.bin").fault == PROTECTED
    assert station.ask(LIST, b"/").data.startswith(b"Flong.bin\t1024\0")
    assert station.server.refused == 1


@pytest.mark.parametrize("opcode", [0, 16, 127, 255])
def test_unknown_requests_are_refused(opcode: int) -> None:
    assert Station().ask(opcode).fault == UNKNOWN


def test_a_size_that_no_message_holds_is_refused() -> None:
    station = Station()
    station.ask(OPEN, b"/long.bin")
    assert station.ask(READ, size=DATA_BYTES + 1).fault == INVALID_SIZE
    assert station.ask(OPEN, b"/long.bin", size=255).fault == INVALID_SIZE


def test_a_closed_session_reads_nothing() -> None:
    station = Station()
    for close in (TERMINATE, RESET):
        station.ask(OPEN, b"/long.bin")
        assert station.ask(close).opcode == ACK
        assert station.ask(READ, size=1).fault == INVALID_SESSION
        assert station.ask(BURST, size=1).fault == INVALID_SESSION
        assert station.ask(close).opcode == ACK  # its answer may have been lost


def test_stations_do_not_close_each_other_s_files() -> None:
    station = Station()
    station.ask(OPEN, b"/long.bin")
    station.ask(OPEN, b"/short.txt", sender=(254, 190))
    station.ask(RESET, sender=(254, 190))
    assert station.ask(READ, size=5).data == LONG[:5]


def test_the_file_unused_for_longest_makes_room() -> None:
    station = Station()
    for session in range(MOST_OPEN):
        station.ask(OPEN, b"/long.bin", session=session)
    station.ask(READ, size=1, session=0)
    station.ask(OPEN, b"/long.bin", session=200)
    assert station.ask(READ, size=1, session=1).fault == INVALID_SESSION
    assert [station.ask(READ, size=1, session=s).opcode for s in (0, 2, 200)] == [ACK] * 3


@pytest.mark.parametrize("to", [(1, 1), (2, 191), (0, 0), (1, 0)])
def test_requests_to_others_are_left_alone(to: tuple[int, int]) -> None:
    assert Station().send(OPEN, b"/long.bin", to=to) == []


@pytest.mark.parametrize("opcode", [ACK, NAK])
def test_an_answer_is_not_answered(opcode: int) -> None:
    assert Station().send(opcode) == []


def test_the_crc_begins_with_zero_and_is_not_inverted() -> None:
    def bitwise(data: bytes) -> int:
        crc = 0
        for byte in data:
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
        return crc

    for data in (b"", b"\0", b"123456789", LONG):
        assert mavlink_crc32(data) == bitwise(data)
    assert struct.unpack("<I", Station().ask(CRC, b"/long.bin").data) == (bitwise(LONG),)


@given(st.lists(st.binary(min_size=251, max_size=251), max_size=20))
def test_any_payload_is_answered_with_at_most_one_message(payloads: list[bytes]) -> None:
    server = FtpServer(FILES)
    for payload in payloads:
        message = received(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 191, payload), 255, 190)
        for answer in (*server.on_message(message, 1, 191), *server.poll(10**18)):
            assert Reply(received(answer)).opcode in (ACK, NAK)
