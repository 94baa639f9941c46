"""MAVLink codec: every valid frame is found, the rest counted, and nothing raised."""

from __future__ import annotations

from hypothesis import example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.wire.codec import Codec
from companion.flight.link.wire.signing import Signing

GARBAGE = st.binary(max_size=60) | st.lists(st.sampled_from([0xFD, 0xFE, 0, 1, 255]), max_size=60).map(bytes)
FLUSH = bytes(300)  # longer than any frame: ends every false start


def sender(system: int = 1, component: int = 1) -> mavlink.MAVLink:
    return mavlink.MAVLink(None, srcSystem=system, srcComponent=component)


def frames(count: int, source: mavlink.MAVLink, *, v1: bool = False) -> list[bytes]:
    out = []
    for index in range(count):
        out.append(mavlink.MAVLink_system_time_message(index, index).pack(source, force_mavlink1=v1))
        source.seq = (source.seq + 1) % 256
    return out


@given(st.lists(st.binary(max_size=400), max_size=8))
@settings(max_examples=300, deadline=None)
def test_arbitrary_bytes_never_raise(chunks: list[bytes]) -> None:
    codec = Codec(191)
    for chunk in chunks:
        list(codec.decode(chunk))
    assert codec.received + codec.bad_bytes <= sum(map(len, chunks))


@given(st.lists(GARBAGE, min_size=4, max_size=4), st.integers(1, 50), st.booleans())
@example(
    [b"", b"", b"\xfe\xfe\xfe", b"\xfe"], 1, False
)  # the checksum of a HEARTBEAT of 254 bytes is right by chance
@settings(max_examples=300, deadline=None)
def test_frames_between_garbage_are_all_found_in_pieces_of_any_size(
    garbage: list[bytes], piece: int, v1: bool
) -> None:
    valid = frames(3, sender(), v1=v1)
    stream = (
        garbage[0] + b"".join(frame + rest for frame, rest in zip(valid, garbage[1:], strict=True)) + FLUSH
    )
    codec = Codec(191)
    found = [m for at in range(0, len(stream), piece) for m in codec.decode(stream[at : at + piece])]
    assert [m.time_boot_ms for m in found if m.get_type() == "SYSTEM_TIME"] == [0, 1, 2]


@given(st.integers(0, 21), st.integers(1, 255))
@settings(max_examples=200, deadline=None)
def test_a_corrupted_frame_is_dropped_and_the_next_one_kept(place: int, flip: int) -> None:
    first, second = frames(2, sender())
    broken = bytearray(first)
    broken[place % len(first)] ^= flip
    codec = Codec(191)
    found = [
        m.time_boot_ms for m in codec.decode(bytes(broken) + second + FLUSH) if m.get_type() == "SYSTEM_TIME"
    ]
    assert found == [1]


def test_a_truncated_frame_is_dropped_and_counted() -> None:
    first, second = frames(2, sender())
    codec = Codec(191)
    assert [m.time_boot_ms for m in codec.decode(first[:-3] + second + FLUSH)] == [1]
    assert codec.bad >= 1
    assert codec.bad_bytes == len(first) - 3 + len(FLUSH)


def test_a_frame_of_an_unknown_message_is_counted_but_is_no_garbage() -> None:
    first, second = frames(2, sender())
    unknown = bytearray(first)
    unknown[7:10] = (16_000_000).to_bytes(3, "little")
    codec = Codec(191)
    assert [m.time_boot_ms for m in codec.decode(bytes(unknown) + second)] == [1]
    assert (codec.unknown, codec.bad_bytes) == (1, 0)


def test_lost_frames_are_counted_per_sender_and_late_ones_are_not() -> None:
    codec = Codec(191)
    mine, other = frames(300, sender(1)), frames(3, sender(2))
    for frame in (*mine[:5], mine[8], mine[7], other[0], mine[9], *mine[10:300], other[1]):
        list(codec.decode(frame))
    assert codec.lost == 3


def test_frames_that_another_vehicle_loses_are_not_lost_of_ours() -> None:
    codec = Codec(191)
    codec.system_id = 3
    ours, other = frames(10, sender(3)), frames(40, sender(2))
    for frame in (*other[::4], *ours[:4], *ours[5:]):
        list(codec.decode(frame))
    assert (codec.received, codec.from_vehicle, codec.lost) == (19, 9, 1)


def test_frames_of_a_station_that_the_autopilot_does_not_pass_on_are_not_lost() -> None:
    codec = Codec(191)
    station, autopilot = frames(40, sender(255, 190)), frames(40, sender(1))
    for frame in (*station[::4], autopilot[0], autopilot[2]):
        list(codec.decode(frame))
    assert (codec.received, codec.lost) == (12, 1)


def test_signed_frames_are_read_without_a_key() -> None:
    source = sender()
    source.signing.secret_key = b"k" * 32
    source.signing.sign_outgoing = True
    assert [m.time_boot_ms for m in Codec(191).decode(b"".join(frames(2, source)))] == [0, 1]


def test_who_signs_is_known_by_the_newest_frame_of_its_autopilot() -> None:
    plain, signed, station = sender(), sender(), sender(255, 190)
    for source in (signed, station):
        source.signing.secret_key = b"k" * 32
        source.signing.sign_outgoing = True
    codec = Codec(191)
    seen = []
    for source in (station, plain, signed, station, plain):
        list(codec.decode(frames(1, source)[0]))
        seen.append(codec.vehicle_signs)
    assert seen == [False, False, True, True, False]


def test_the_verdict_on_the_autopilot_is_that_of_its_newest_frame() -> None:
    codec = Codec(191, Signing(b"k" * 32))
    list(codec.decode(frames(1, sender(255, 190))[0]))
    assert codec.autopilot_verdict is None
    list(codec.decode(frames(1, sender())[0]))
    assert codec.autopilot_verdict == "unsigned"


def test_what_we_send_is_numbered_mavlink_2_from_the_vehicle_s_system() -> None:
    codec = Codec(191)
    codec.system_id = 7
    out = [codec.encode(mavlink.MAVLink_system_time_message(0, 5)) for _ in range(257)]
    seen = [m for data in out for m in Codec(1).decode(data)]
    assert [m.get_seq() for m in seen] == [i % 256 for i in range(257)]
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in seen} == {(7, 191)}
    assert out[0][0] == 0xFD
