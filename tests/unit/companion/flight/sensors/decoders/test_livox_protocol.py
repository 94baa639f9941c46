"""Handshake with a Mid-360, against the simulated sensor."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from companion.flight.sensors.decoders.livox_protocol import (
    ANSWER,
    HEADER_BYTES,
    SET_PARAMETERS,
    Frame,
    LivoxControl,
    decode,
    encode,
    parameters,
)
from tests.unit.companion.flight.sensors.decoders.livox_control_unit import ControlUnit

SECOND = 1_000_000_000


def test_the_sensor_is_set_to_sampling_and_to_our_address() -> None:
    sensor, control = ControlUnit(data_type=3), LivoxControl("192.168.1.5", 56301)
    request = control.due(0, None)
    assert request is not None
    answer = sensor.receive(request)
    assert answer is not None
    assert control.on_datagram(answer)
    assert sensor.sampling
    assert sensor.point_host == ("192.168.1.5", 56301)
    assert sensor.data_type == 1


def test_it_asks_each_second_until_answered_and_then_no_more_while_points_come() -> None:
    sensor, control = ControlUnit(), LivoxControl("192.168.1.5", 56301)
    asked = [t for t in range(50) if control.due(t * SECOND // 10, None) is not None]
    assert asked == [0, 10, 20, 30, 40]
    request = control.due(5 * SECOND, None)
    assert request is not None
    control.on_datagram(sensor.receive(request) or b"")
    assert all(control.due(t * SECOND, t * SECOND) is None for t in range(5, 20))


def test_it_asks_again_when_the_points_stop() -> None:
    sensor, control = ControlUnit(), LivoxControl("192.168.1.5", 56301)
    control.on_datagram(sensor.receive(control.due(0, None) or b"") or b"")
    assert control.due(2 * SECOND, 0) is None
    assert control.due(4 * SECOND, 0) is not None


def test_a_refusal_names_the_parameter() -> None:
    control = LivoxControl("192.168.1.5", 56301)
    control.due(0, None)
    assert control.on_datagram(encode(Frame(SET_PARAMETERS, 1, ANSWER, b"\x20\x1a\x00"), sender=1))
    assert "0x001a" in control.refused


def test_it_counts_as_answering_until_a_request_has_waited_for_a_second() -> None:
    sensor, control = ControlUnit(), LivoxControl("192.168.1.5", 56301)
    request = control.due(0, None)
    assert not control.answered
    control.on_datagram(sensor.receive(request or b"") or b"")
    assert control.answered
    assert control.due(3 * SECOND, None) is not None  # no points: asked again, and the answer is on its way
    assert control.answered
    assert control.due(4 * SECOND, None) is not None
    assert not control.answered


def answered(control: LivoxControl, sensor: ControlUnit, at_ns: int) -> None:
    request = control.due(at_ns, at_ns)
    assert request is not None
    assert control.on_datagram(sensor.receive(request) or b"")


def test_inertial_samples_are_asked_for_once_the_points_come() -> None:
    sensor, control = ControlUnit(), LivoxControl("192.168.1.5", 56301, 56401)
    answered(control, sensor, 0)
    assert control.due(SECOND, None) is None
    assert (sensor.imu_enabled, sensor.imu_host) == (False, None)
    answered(control, sensor, 5 * SECOND)
    assert (sensor.imu_enabled, sensor.imu_host) == (True, ("192.168.1.5", 56401))
    assert all(control.due(t * SECOND, t * SECOND) is None for t in range(6, 20))


def test_the_bytes_that_ask_for_inertial_samples() -> None:
    sensor, control = ControlUnit(), LivoxControl("192.168.1.5", 56301, 56401)
    answered(control, sensor, 0)
    request = control.due(SECOND, SECOND)
    assert request is not None
    assert request[HEADER_BYTES:].hex() == "0200000007000800c0a8010551dc50dc1c00010001"


def test_a_sensor_that_refuses_them_keeps_sampling_and_is_not_asked_again() -> None:
    control = LivoxControl("192.168.1.5", 56301, 56401)
    answered(control, ControlUnit(), 0)
    assert control.due(SECOND, SECOND) is not None
    assert control.on_datagram(encode(Frame(SET_PARAMETERS, 2, ANSWER, b"\x20\x1c\x00"), sender=1))
    assert "0x001c" in control.refused
    assert all(control.due(t * SECOND, t * SECOND) is None for t in range(2, 20))


def test_a_sensor_that_does_not_answer_about_them_is_left_alone() -> None:
    control = LivoxControl("192.168.1.5", 56301, 56401)
    answered(control, ControlUnit(), 0)
    asked = [t for t in range(1, 60) if control.due(t * SECOND, t * SECOND) is not None]
    assert asked == [1, 2, 3, 4, 5]


def test_after_a_power_cycle_both_are_asked_for_again() -> None:
    sensor, control = ControlUnit(), LivoxControl("192.168.1.5", 56301, 56401)
    answered(control, sensor, 0)
    answered(control, sensor, SECOND)
    again = ControlUnit()
    request = control.due(10 * SECOND, 2 * SECOND)
    assert request is not None
    control.on_datagram(again.receive(request) or b"")
    answered(control, again, 11 * SECOND)
    assert again.sampling
    assert again.imu_enabled


def test_answers_to_something_else_are_passed_over() -> None:
    control = LivoxControl("192.168.1.5", 56301)
    control.due(0, None)
    for frame in (
        Frame(SET_PARAMETERS, 9, ANSWER, bytes(3)),
        Frame(0x0101, 1, ANSWER, bytes(3)),
        Frame(SET_PARAMETERS, 1, 0, bytes(3)),
    ):
        assert not control.on_datagram(encode(frame, sender=1))


@given(st.binary(max_size=80))
def test_garbage_is_neither_a_message_nor_a_command(data: bytes) -> None:
    assert decode(data) is None
    assert ControlUnit().receive(data) is None


@given(st.integers(0, 10_000), st.integers(0, 7))
def test_a_flipped_bit_is_found_on_both_sides(at: int, bit: int) -> None:
    whole = bytearray(encode(Frame(SET_PARAMETERS, 7, 0, parameters({0x1A: b"\1"}))))
    whole[at % len(whole)] ^= 1 << bit
    sensor = ControlUnit()
    assert decode(bytes(whole)) is None
    assert sensor.receive(bytes(whole)) is None
    assert not sensor.sampling


def test_parameters_are_set_all_or_none() -> None:
    sensor = ControlUnit()
    bad = parameters({0x1A: b"\1", 0x7777: b"\1"})
    answer = sensor.receive(encode(Frame(SET_PARAMETERS, 1, 0, bad)))
    assert answer is not None
    assert answer[HEADER_BYTES:] == b"\x20\x77\x77"
    assert not sensor.sampling
