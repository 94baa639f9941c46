"""Messages that concern somebody else, or say too little yet, call for nothing."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.codec import Codec
from companion.link.inbox import Inbox
from companion.link.operator import CommandServer
from tests.unit.companion.link.messages import attitude, heartbeat, position, received

S = 1_000_000_000
US = 191
LAND = mavlink.MAV_CMD_NAV_LAND


class Desk:
    """An inbox that has heard its vehicle, and what it said since."""

    def __init__(self) -> None:
        self.inbox = Inbox(Codec(US), CommandServer())
        self.said: list[str] = []
        self.inbox.acknowledged.subscribe(lambda *_: self.said.append("acknowledged"))
        self.inbox.attitude.subscribe(lambda *_: self.said.append("attitude"))
        self.inbox.position.subscribe(lambda *_: self.said.append("position"))
        self.inbox.take(heartbeat(), S)

    def hear(self, message: Any, now_ns: int = 2 * S) -> list[str]:
        self.said.clear()
        self.inbox.take(message, now_ns)
        return self.said


@pytest.mark.parametrize(
    ("system", "component", "ours"),
    [(0, 0, True), (1, US, True), (1, 0, True), (255, 190, False), (1, 190, False), (2, US, False)],
)
def test_the_answer_to_somebody_else_s_command_is_not_ours(system: int, component: int, ours: bool) -> None:
    message = mavlink.MAVLink_command_ack_message(LAND, 0, 255, 0, system, component)
    assert Desk().hear(received(message)) == ["acknowledged"] * ours


@pytest.mark.parametrize(("kind", "name"), [(attitude, "attitude"), (position, "position")])
def test_a_pose_whose_stamp_cannot_be_is_kept_and_not_told(kind: Any, name: str) -> None:
    desk = Desk()
    assert desk.hear(kind(1000)) == [name]
    assert desk.hear(kind(1100), 62 * S) == []  # a minute under way
    assert desk.inbox.clock.implausible == 1
