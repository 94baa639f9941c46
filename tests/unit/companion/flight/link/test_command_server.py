"""Incoming commands: only those addressed to the companion, always answered, executed once."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.command_server import Answer, CommandReply, CommandServer, OperatorCommand
from tests.unit.companion.flight.link.messages import received

S = 1_000_000_000
USER = mavlink.MAV_CMD_USER_1


class Desk:
    """A server, what it carried out, and a sender with its own numbering."""

    def __init__(self) -> None:
        self.done: list[OperatorCommand] = []
        self.server = CommandServer()
        self.server.handler = self._carry_out
        self.sequence = 0

        self.refuses = self.always = False
        self.stands = True

    def _carry_out(self, command: OperatorCommand) -> CommandReply:
        self.done.append(command)
        reason = f"number {len(self.done)}"
        reply = CommandReply.denied(reason) if self.refuses else CommandReply.accepted(reason)
        return replace(reply, always=self.always, is_in_effect=lambda: self.stands)

    def long(
        self,
        what: float,
        at_s: float,
        confirmation: int = 0,
        *,
        to: tuple[int, int] = (1, 191),
        system: int = 255,
        sequence: int | None = None,
    ) -> Answer | None:
        p = (what, math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)
        message = mavlink.MAVLink_command_long_message(*to, USER, confirmation, *p)
        return self._take(message, at_s, system, sequence)

    def int(self, what: float, at_s: float, frame: int = 5) -> Answer | None:
        message = mavlink.MAVLink_command_int_message(
            1, 191, frame, USER, 0, 0, what, 1.0, 0.0, 0.0, 470_000_000, -80_000_000, 412.5
        )
        return self._take(message, at_s, 255)

    def _take(self, message: Any, at_s: float, system: int, sequence: int | None = None) -> Answer | None:
        if sequence is None:
            self.sequence += 1
            sequence = self.sequence % 256
        return self.server.handle_command(received(message, system, 190, sequence), 1, 191, round(at_s * S))


def test_a_command_is_carried_out_and_acknowledged_to_its_sender() -> None:
    desk = Desk()
    answer = desk.long(1, 10)
    assert answer is not None
    assert answer.executed
    ack = answer.ack
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (USER, 0, 255, 190)
    assert desk.done[0].params[0] == 1


@pytest.mark.parametrize("to", [(0, 0), (0, 191), (1, 0), (1, 1), (2, 191)])
def test_a_command_to_everybody_or_to_another_is_left_alone(
    to: tuple[int, int],
) -> None:
    desk = Desk()
    assert desk.long(1, 10, to=to) is None
    assert desk.done == []


def test_retransmissions_are_answered_alike_and_not_carried_out_again() -> None:
    desk = Desk()
    answers = [desk.long(1, 10), desk.long(1, 11, 1), desk.long(1, 14, 2), desk.long(1, 15, 2)]
    assert [a and a.reply.reason for a in answers] == ["number 1"] * 3 + ["number 2"]
    assert [a and a.executed for a in answers] == [True, False, False, True]


def test_an_uncounted_repetition_within_a_moment_is_a_retransmission_and_later_one_is_meant() -> None:
    desk = Desk()
    assert [a and a.executed for a in (desk.int(1, 10), desk.int(1, 11), desk.int(1, 12))] == [
        True,
        False,
        True,
    ]


def test_an_uncounted_repetition_of_a_refused_command_is_meant_anew() -> None:
    desk = Desk()
    desk.refuses = True
    desk.int(1, 10)
    desk.refuses = False
    answer = desk.int(1, 11)
    assert answer is not None
    assert (answer.executed, answer.ack.result) == (True, mavlink.MAV_RESULT_ACCEPTED)


def test_an_uncounted_repetition_of_what_stands_no_more_is_meant_anew() -> None:
    desk = Desk()
    desk.int(1, 10)
    desk.stands = False
    answer = desk.int(1, 11)
    assert answer is not None
    assert answer.executed


@pytest.mark.parametrize(("name", "value"), [("refuses", True), ("stands", False)])
def test_a_counted_retransmission_orders_nothing_anew(name: str, value: bool) -> None:
    """Its sender has not seen the answer: it does not know that somebody else has ordered an abort since."""
    desk = Desk()
    setattr(desk, name, value)
    desk.long(1, 10)
    answer = desk.long(1, 11, 1)
    assert answer is not None
    assert not answer.executed


def test_a_command_to_be_carried_out_always_is_so_at_each_frame_of_its_own() -> None:
    desk = Desk()
    desk.always = True
    executed = [desk.long(0, 10), desk.long(0, 10.1), desk.long(0, 10.2, 1)]
    desk.sequence -= 1  # the network repeats the last frame
    executed.append(desk.long(0, 10.3, 1))
    assert [a and a.executed for a in executed] == [True, True, True, False]


def test_a_retry_whose_first_try_was_lost_is_carried_out() -> None:
    desk = Desk()
    desk.long(1, 10, 2)
    assert len(desk.done) == 1


def test_land_abort_land_in_one_second_are_three_commands() -> None:
    desk = Desk()
    for at_s, what in ((10.0, 1), (10.3, 0), (10.6, 1)):
        desk.long(what, at_s)
    assert [c.params[0] for c in desk.done] == [1, 0, 1]


def test_a_frame_that_comes_again_after_another_command_is_answered_alike_and_not_carried_out_again() -> None:
    desk = Desk()
    script = ((10.0, 1, 7), (10.2, 0, 8), (10.3, 1, 7), (10.4, 0, 8))
    answers = [desk.long(what, at_s, sequence=sequence) for at_s, what, sequence in script]
    assert [a and a.reply.reason for a in answers] == ["number 1", "number 2", "number 1", "number 2"]
    assert [a and a.executed for a in answers] == [True, True, False, False]
    assert [c.params[0] for c in desk.done] == [1, 0]
    assert desk.server.repeated == 2


def test_a_number_that_comes_again_later_or_with_another_command_is_no_frame_come_twice() -> None:
    desk = Desk()
    for at_s, what, sequence in ((10.0, 1, 7), (10.2, 0, 8), (10.3, 3, 7), (12.0, 1, 7)):
        desk.long(what, at_s, sequence=sequence)
    assert [c.params[0] for c in desk.done] == [1, 0, 3, 1]


def test_the_same_command_of_two_senders_is_two_commands() -> None:
    desk = Desk()
    desk.long(1, 10, system=255)
    desk.long(1, 10, system=254)
    assert len(desk.done) == 2


def test_without_a_handler_every_command_is_unsupported() -> None:
    desk = Desk()
    desk.server.handler = None
    answer = desk.long(1, 10)
    assert answer is not None
    assert answer.ack.result == mavlink.MAV_RESULT_UNSUPPORTED


@pytest.mark.parametrize(
    ("frame", "scale"), [(0, 1e-7), (3, 1e-7), (5, 1e-7), (6, 1e-7), (11, 1e-7), (1, 1e-4)]
)
def test_places_are_degrees_in_global_frames_and_metres_in_local_ones(frame: int, scale: float) -> None:
    desk = Desk()
    desk.int(3, 10, frame)
    command = desk.done[0]
    assert (command.x, command.y, command.z) == pytest.approx(
        (470_000_000 * scale, -80_000_000 * scale, 412.5)
    )
    assert command.frame == frame


def test_memory_of_senders_is_bounded() -> None:
    desk = Desk()
    for system in range(1, 101):
        desk.long(1, 10, system=system, sequence=7)
    for number in range(100):
        desk.long(number, 10, system=100, sequence=number)

    def remembered(asked: Iterable[Answer | None]) -> int:
        return sum(answer is not None and not answer.executed for answer in asked)

    # The newest first: what is forgotten is carried out again, and then takes the oldest one's place.
    numbers, systems = range(99, -1, -1), range(99, 0, -1)
    assert 1 <= remembered(desk.long(number, 10, system=100, sequence=number) for number in numbers) <= 8
    assert 1 <= remembered(desk.long(1, 10, system=system, sequence=7) for system in systems) <= 15


@given(st.lists(st.tuples(st.sampled_from([0, 1]), st.integers(0, 3), st.integers(0, 5000)), max_size=20))
def test_every_command_to_us_gets_exactly_one_answer(script: list[tuple[int, int, int]]) -> None:
    desk = Desk()
    at_s = 0.0
    for what, confirmation, pause_ms in script:
        at_s += pause_ms / 1000
        assert desk.long(what, at_s, confirmation) is not None
    assert desk.server.executed + desk.server.repeated == len(script)
    assert desk.server.executed == len(desk.done)
