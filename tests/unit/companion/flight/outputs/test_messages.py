"""Texts and setpoints in their wire format."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.statustext import named_value, statustext
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.outputs.setpoint import hold_setpoint, velocity_setpoint

VEHICLE = VehicleState(sysid=3, boot_ms=1234)


def joined(messages: list[object]) -> bytes:
    """Join parts as a receiver does, over the wire: up to the first part that is not full."""
    wire, text = mavlink.MAVLink(None), b""
    for number, message in enumerate(messages):
        seen = mavlink.MAVLink(None).parse_buffer(message.pack(wire))[0]  # type: ignore[attr-defined]
        assert seen.chunk_seq == number
        part = seen.text.encode() if isinstance(seen.text, str) else seen.text
        text += part
        ends = len(part) < 50 or seen.id == 0
        assert ends == (number == len(messages) - 1), "only the last part may end the text"
    return text


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=130))
@example("x" * 50)
@example("x" * 100)
def test_a_text_of_any_length_arrives_whole(text: str) -> None:
    messages = statustext(text, 6, 7)
    assert joined(messages) == text.encode()
    assert {m.id for m in messages} == ({0} if len(text) <= 50 else {7})


def test_a_long_text_ends_after_four_hundred_bytes() -> None:
    assert joined(statustext("u" * 500, 6, 7)) == b"u" * 397 + b"..."


def test_what_no_ground_station_shows_is_replaced() -> None:
    assert joined(statustext("slope 7°", 6, 7)) == b"slope 7?"


def test_a_velocity_is_north_east_down_and_keeps_the_heading() -> None:
    message = velocity_setpoint(VEHICLE, (1.0, 2.0, 0.5))
    assert (message.vx, message.vy, message.vz) == (2.0, 1.0, -0.5)
    assert (message.target_system, message.target_component, message.coordinate_frame) == (3, 1, 1)
    assert message.type_mask == 0b0000_0101_1100_0111
    assert (message.yaw_rate, message.time_boot_ms) == (0, 1234)


def test_a_heading_is_turned_to_and_wrapped() -> None:
    message = velocity_setpoint(VEHICLE, (0, 0, 0), yaw_rad=1.5 * math.pi)
    assert message.type_mask == 0b0000_1001_1100_0111
    assert message.yaw == pytest.approx(-0.5 * math.pi)


def test_hold_has_no_velocity() -> None:
    message = hold_setpoint(VEHICLE)
    assert (message.vx, message.vy, message.vz) == (0, 0, 0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_is_never_sent(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        velocity_setpoint(VEHICLE, (0, bad, 0))


def test_named_values_are_cut_at_ten_bytes() -> None:
    message = named_value("SLZ_CERTAINTY", 0.5, 2**32 + 7)
    assert (message.time_boot_ms, message.name, message.value) == (7, "SLZ_CERTAI", 0.5)
