"""Outgoing commands: retried, counted, ended by an answer; as scripts of time and acknowledgements."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.command import Command, CommandCall, CommandResult
from companion.flight.link.commander import Commander
from companion.runtime.clock import now_ns
from tests.integration.link_bench import virtually
from tests.unit.companion.flight.link.messages import acknowledgement

S = 1_000_000_000
LAND = mavlink.MAV_CMD_NAV_LAND
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
GUIDED_MODE, LAND_MODE = 4.0, 9.0
IN_PROGRESS = mavlink.MAV_RESULT_IN_PROGRESS


def call(tries: int = 3) -> CommandCall:
    return CommandCall(Command(LAND), timeout_ns=S, tries=tries)


def test_an_accepted_command_is_sent_once() -> None:
    c = call()
    assert c.poll(0) == 0
    assert c.poll(S // 2) is None
    c.acknowledge(acknowledgement(LAND, 0), S // 2)
    assert c.result is not None
    assert (c.result.ok, c.result.outcome, c.result.tries) == (True, "accepted", 1)


def test_without_an_answer_it_is_sent_again_and_then_times_out() -> None:
    c = call()
    sent = [(t, n) for t in range(0, 6 * S, S // 4) if (n := c.poll(t)) is not None]
    assert sent == [(0, 0), (S, 1), (2 * S, 2)]
    assert c.result is not None
    assert (c.result.outcome, c.result.tries) == ("timeout", 3)


@pytest.mark.parametrize(
    ("result", "outcome"),
    [
        (1, "temporarily_rejected"),
        (2, "denied"),
        (3, "unsupported"),
        (4, "failed"),
        (6, "cancelled"),
        (77, "failed"),
    ],
)
def test_a_refusal_is_a_value(result: int, outcome: str) -> None:
    c = call()
    c.poll(0)
    c.acknowledge(acknowledgement(LAND, result), 1)
    assert c.result is not None
    assert (c.result.ok, c.result.outcome) == (False, outcome)


def test_in_progress_ends_the_retries_and_prolongs_the_wait() -> None:
    c = call()
    c.poll(0)
    c.acknowledge(acknowledgement(LAND, IN_PROGRESS, progress=40), S // 2)
    assert [c.poll(t) for t in range(S, 10 * S, S)] == [None] * 9
    assert (c.result, c.progress_pct) == (None, 40)
    c.acknowledge(acknowledgement(LAND, 0), 10 * S)
    assert c.result is not None
    assert c.result.ok


def test_progress_that_never_ends_is_a_timeout() -> None:
    c = call()
    c.poll(0)
    c.acknowledge(acknowledgement(LAND, IN_PROGRESS), S)
    assert c.poll(12 * S) is None
    assert c.result is not None
    assert c.result.outcome == "timeout"


def test_the_answer_to_another_command_or_before_sending_is_not_ours() -> None:
    c = call()
    c.acknowledge(acknowledgement(LAND, 0), 0)
    c.poll(0)
    c.acknowledge(acknowledgement(LAND + 1, 0), 0)
    assert c.result is None


def test_retries_are_numbered_in_command_long() -> None:
    message = Command(LAND, (1.0, 2.0)).message(7, 1, 2)
    assert (message.target_system, message.target_component, message.confirmation) == (7, 1, 2)
    assert (message.param1, message.param2, message.param7) == (1.0, 2.0, 0.0)


def test_a_frame_makes_it_a_command_int() -> None:
    message = Command(LAND, (0.0, 1.0), frame=6, x=470_000_001, y=-5, z=12.5).message(7, 1, 0)
    assert message.get_type() == "COMMAND_INT"
    assert (message.frame, message.x, message.y, message.z, message.param2) == (6, 470_000_001, -5, 12.5, 1.0)


def test_a_command_that_has_its_answer_is_not_superseded() -> None:
    c = call()
    c.poll(0)
    c.acknowledge(acknowledgement(LAND, 0), S)
    c.supersede()
    assert c.result is not None
    assert c.result.outcome == "accepted"


async def test_an_answer_to_a_command_that_nobody_sent_is_passed_over() -> None:
    sent: list[int] = []

    def send(command: Command, attempt: int) -> bool:
        sent.append(attempt)
        commander.acknowledge(acknowledgement(LAND + 1, 0), now_ns())
        commander.acknowledge(acknowledgement(LAND, 2), now_ns())
        return True

    commander = Commander(send)
    result = await commander.run(Command(LAND), timeout_s=60.0, tries=3)
    assert (result.outcome, sent) == ("denied", [0])


class Line:
    """Commands sent over a line, one after the other superseding or cancelling the one before."""

    def __init__(self) -> None:
        self.commander = Commander(self._send)
        self.sent: list[float] = []
        self.calls: list[asyncio.Task[CommandResult]] = []

    def _send(self, command: Command, _attempt: int) -> bool:
        self.sent.append(command.params[0])
        return True

    async def ask(self, mode: float) -> None:
        run = self.commander.run(Command(SET_MODE, (mode,)), timeout_s=1.5, tries=3, supersede=True)
        self.calls.append(asyncio.create_task(run))
        await asyncio.sleep(0.1)

    async def answer(self, result: int = 0) -> None:
        self.commander.acknowledge(acknowledgement(SET_MODE, result), now_ns())
        await asyncio.sleep(0.1)


@pytest.mark.parametrize("cancelled", [False, True])
def test_the_answer_to_the_command_before_is_not_that_to_the_new_one(cancelled: bool) -> None:
    """GUIDED after LAND is the same command: the late answer to LAND must not end the request for GUIDED."""

    async def script() -> None:
        line = Line()
        await line.ask(LAND_MODE)
        if cancelled:
            line.calls[0].cancel()
            await asyncio.sleep(0)
        await line.ask(GUIDED_MODE)
        await line.answer()
        assert not line.calls[1].done()
        await asyncio.sleep(1.6)  # the request was lost
        assert line.sent == [LAND_MODE, GUIDED_MODE, GUIDED_MODE]
        await line.answer(2)
        assert line.calls[1].result().outcome == "denied"

    virtually(script)


def test_an_answer_that_never_came_is_waited_for_no_longer_than_it_may_take() -> None:
    async def script() -> None:
        line = Line()
        await line.ask(LAND_MODE)
        await asyncio.sleep(1.2)
        await line.ask(GUIDED_MODE)
        await asyncio.sleep(0.2)
        await line.answer()
        assert line.calls[1].result().ok

    virtually(script)


def test_a_command_answered_in_time_owes_the_next_one_nothing() -> None:
    async def script() -> None:
        line = Line()
        for mode in (LAND_MODE, GUIDED_MODE):
            await line.ask(mode)
            await line.answer()
        assert [call.result().ok for call in line.calls] == [True, True]

    virtually(script)
