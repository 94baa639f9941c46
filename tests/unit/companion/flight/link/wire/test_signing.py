"""Signed links, with pymavlink's signing at the other end."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.wire.codec import Codec
from companion.flight.link.wire.signing import MARGIN_TICKS, SAVE_TICKS, Signing

KEY, OTHER = bytes(range(32)), b"x" * 32
NOW = 36_000_000_000  # ticks: four days after the beginning of 2015
S = 100_000
COMMAND = mavlink.MAVLink_command_long_message(1, 191, mavlink.MAV_CMD_USER_1, 0, *[1.0] * 7)
SET = mavlink.MAVLink_param_set_message(1, 191, b"SLZ_FINAL_H", 5.0, 9)
TIME = mavlink.MAVLink_system_time_message(1, 2)


class Other:
    """A key holder's end, or that of one who would like to be."""

    def __init__(self, key: bytes | None = KEY, tick: int = NOW, system: int = 1) -> None:
        self.mavlink = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self.mavlink.signing.secret_key = key
        self.mavlink.signing.sign_outgoing = key is not None
        self.mavlink.signing.timestamp = tick

    def frame(self, message: Any = TIME) -> bytes:
        data = bytes(message.pack(self.mavlink))
        self.mavlink.seq = (self.mavlink.seq + 1) % 256
        return data

    def reads(self, data: bytes) -> Any:
        return self.mavlink.decode(bytearray(data))


def codec(saved: int = 0, wall: int = NOW) -> tuple[Codec, Signing]:
    signing = Signing(KEY, saved, lambda: wall)
    return Codec(191, signing), signing


def heard(reader: Codec, *frames: bytes) -> int:
    return sum(len(list(reader.decode(frame))) for frame in frames)


def test_signed_frames_are_read_and_ours_satisfy_pymavlink() -> None:
    reader, signing = codec()
    other = Other()
    assert heard(reader, other.frame(), other.frame(COMMAND)) == 2
    assert signing.good == 2
    for _ in range(3):
        assert other.reads(reader.encode(TIME)).get_signed()
    assert other.mavlink.signing.goodsig_count == 3


@pytest.mark.parametrize("message", [COMMAND, SET, TIME])
@pytest.mark.parametrize(("key", "counter"), [(None, "unsigned"), (OTHER, "forged")])
def test_what_no_key_holder_signed_is_refused_and_counted(
    message: Any, key: bytes | None, counter: str
) -> None:
    reader, signing = codec()
    assert heard(reader, Other(key).frame(message)) == 0
    assert getattr(signing, counter) == signing.refused == 1
    assert reader.refused_orders == (message is not TIME)
    assert reader.received == reader.bad == 0


def test_mavlink_1_cannot_be_signed_and_is_refused() -> None:
    reader, signing = codec()
    assert heard(reader, bytes(TIME.pack(Other(None).mavlink, force_mavlink1=True))) == 0
    assert signing.unsigned == 1


def test_a_frame_heard_before_is_refused_and_so_is_an_older_one() -> None:
    reader, signing = codec()
    other = Other()
    first, second = other.frame(COMMAND), other.frame(COMMAND)
    assert heard(reader, second, second, first) == 1
    assert (signing.good, signing.replayed, reader.refused_orders) == (1, 2, 2)


@pytest.mark.parametrize(("late_s", "taken"), [(59, 1), (61, 0)])
def test_a_new_sender_may_be_a_minute_behind(late_s: int, taken: int) -> None:
    reader, _ = codec()
    assert heard(reader, Other(tick=NOW - late_s * S).frame()) == taken


def test_senders_components_and_links_are_told_apart() -> None:
    reader, signing = codec()
    late, early = Other(tick=NOW + 5, system=2), Other(tick=NOW, system=1)
    assert heard(reader, late.frame(), early.frame()) == 2
    early.mavlink.signing.timestamp, early.mavlink.signing.link_id = NOW, 3
    assert heard(reader, early.frame()) == 1
    assert signing.refused == 0


def test_a_forged_timestamp_does_not_shut_the_true_sender_out() -> None:
    reader, _ = codec()
    assert heard(reader, Other(OTHER, tick=2**48 - 1).frame(), Other().frame()) == 1


def test_radios_report_unsigned() -> None:
    reader, signing = codec()
    assert heard(reader, Other(None).frame(mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7))) == 1
    assert (signing.allowed, signing.refused) == (1, 0)


def test_timestamps_follow_the_date_and_never_go_back() -> None:
    wall = [NOW]
    signing = Signing(KEY, 0, lambda: wall[0])
    ticks = [signing.next_tick() for _ in range(3)]
    wall[0] = NOW + S
    ticks.append(signing.next_tick())
    wall[0] = NOW - 1000 * S
    ticks.append(signing.next_tick())
    assert ticks == [NOW + 1, NOW + 2, NOW + 3, NOW + S, NOW + S + 1]


def test_a_key_holder_s_later_clock_is_taken_over() -> None:
    reader, signing = codec()
    heard(reader, Other(tick=NOW + 500 * S).frame())
    assert signing.next_tick() == NOW + 500 * S + 1


def test_after_a_restart_with_a_clock_set_back_timestamps_go_on_from_the_saved_one() -> None:
    wall = [NOW]
    before = Signing(KEY, 0, lambda: wall[0])
    other, saved = Other(), 0
    for _ in range(400):  # twenty seconds of traffic
        wall[0] += S // 20
        saved = before.to_save() or saved
        last = before.next_tick()
    assert last - saved <= SAVE_TICKS + S
    after = Codec(191, Signing(KEY, saved, lambda: 0))
    other.mavlink.signing.stream_timestamps[(0, 1, 191)] = last
    assert other.reads(after.encode(TIME)).get_signed()


def test_a_quick_restart_with_a_good_clock_still_hears_everybody() -> None:
    reader, _ = codec(saved=NOW, wall=NOW)
    assert heard(reader, Other(tick=NOW - MARGIN_TICKS).frame()) == 1


@given(st.integers(0, 50), st.integers(1, 255))
@settings(max_examples=300, deadline=None)
def test_no_changed_byte_gets_through(place: int, flip: int) -> None:
    frame = bytearray(Other().frame(COMMAND))
    frame[place % len(frame)] ^= flip
    reader, signing = codec()
    assert heard(reader, bytes(frame) + bytes(300)) == 0
    assert signing.good == 0


def test_a_key_has_32_bytes() -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        Signing(b"short")
