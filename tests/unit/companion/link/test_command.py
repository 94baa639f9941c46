"""Our commands: retried, counted, ended by an answer; as scripts of time and acknowledgements."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.clock import now_ns
from companion.link.command import Command, CommandCall
from companion.link.commander import Commander
from tests.unit.companion.link.messages import acknowledgement

S = 1_000_000_000
LAND = mavlink.MAV_CMD_NAV_LAND
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
