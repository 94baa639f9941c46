"""The switch of ArduPilot's position source: times of commands, repetitions, and what the pilot is told."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link import navigation_source
from companion.flight.link.autopilot_health import Health
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import UNKNOWN, Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.command import CommandResult, Outcome
from companion.flight.link.link import Link
from companion.flight.link.navigation_source import GPS, LIDAR, NavigationSource, can_switch
from companion.flight.link.vehicle_state import VehicleState
from companion.runtime.event import Event

MS, S = 1_000_000, 1_000_000_000
SET = {"VISO_TYPE": 1.0, "EK3_SRC2_POSXY": 6.0}
LOST, BACK = "GPS lost: position from the LiDAR", "GPS back: position from GPS"
REFUSED, NOTHING = "LiDAR position refused: take over", "no GPS, no LiDAR position: take over"


class Script:
    """An autopilot that answers commands as it is told to, and what the pilot is told."""

    def __init__(self) -> None:
        self.source = NavigationSource()
        self.now = 0
        self.accepts = True
        self.commands: list[tuple[float, int]] = []

    def run(self, seconds: float, *, lost: bool, healthy: bool) -> list[str]:
        """Let time pass and return the texts."""
        texts = []
        for _ in range(round(seconds / 0.05)):
            self.now += 50 * MS
            wanted = self.source.update(lost, healthy, self.now)
            if wanted is not None:
                self.commands.append((self.now / S, wanted))
                self.source.record_result(wanted, self.accepts)
            for text, severity in self.source.pop_texts():
                assert len(text) <= 50
                assert (severity == mavlink.MAV_SEVERITY_CRITICAL) == ("take over" in text)
                texts.append(text.removeprefix("SLZ: "))
        return texts


def test_texts_name_an_odometry_that_is_not_the_lidar_s() -> None:
    script = Script()
    script.source = NavigationSource("odometry")
    assert script.run(1, lost=True, healthy=True) == ["GPS lost: position from the odometry"]
    assert script.run(5, lost=True, healthy=False) == ["no GPS, no odometry position: take over"]


def test_the_lidar_is_commanded_at_once_and_gps_when_it_was_good_for_five_seconds() -> None:
    script = Script()
    assert script.run(10, lost=False, healthy=True) == []
    assert script.run(20, lost=True, healthy=True) == [LOST]
    assert script.source.active == LIDAR
    assert script.run(4.9, lost=False, healthy=True) == []
    assert script.run(1, lost=True, healthy=True) == []
    assert script.run(5, lost=False, healthy=True) == []
    assert script.run(1, lost=False, healthy=True) == [BACK]
    assert [(when, which) for when, which in script.commands if which == LIDAR] == [(10.05, LIDAR)]
    assert [which for _, which in script.commands] == [LIDAR, GPS]
    assert script.source.active == GPS


def test_without_an_odometry_nothing_is_switched_until_there_is_one() -> None:
    script = Script()
    assert script.run(5, lost=True, healthy=False) == []
    assert script.commands == []
    assert script.run(1, lost=True, healthy=True) == [LOST]


def test_a_refusal_is_repeated_each_second_and_told_once() -> None:
    script = Script()
    script.accepts = False
    assert script.run(10, lost=True, healthy=True) == [REFUSED]
    assert [when for when, _ in script.commands] == pytest.approx([0.05 + n for n in range(10)])
    script.accepts = True
    assert script.run(2, lost=True, healthy=True) == [LOST]
    script.accepts = False
    assert script.run(20, lost=False, healthy=True) == ["GPS back, its use refused"]
    assert script.source.active == LIDAR


def test_a_refused_switch_that_is_no_longer_worth_it_is_not_repeated() -> None:
    script = Script()
    script.accepts = False
    script.run(0.5, lost=True, healthy=True)
    script.run(10, lost=True, healthy=False)
    assert len(script.commands) == 1


def test_the_pilot_is_called_once_when_the_odometry_that_the_vehicle_flies_by_ends() -> None:
    script = Script()
    script.run(2, lost=True, healthy=True)
    assert script.run(1, lost=True, healthy=False) == []  # a second without an estimate is none
    assert script.run(30, lost=True, healthy=False) == [NOTHING]
    assert script.run(5, lost=True, healthy=True) == []
    assert script.run(5, lost=True, healthy=False) == [NOTHING]
    assert script.run(2, lost=False, healthy=False) == [BACK], "there is nothing better to wait for"


def test_an_autopilot_that_rebooted_uses_gps() -> None:
    script = Script()
    script.run(2, lost=True, healthy=True)
    script.source.forget()
    assert script.source.active == GPS
    assert script.run(20, lost=False, healthy=True) == []
    assert len(script.commands) == 1


@pytest.mark.parametrize(
    ("autopilot", "parameters", "can"),
    [
        (ARDUPILOT, SET, True),
        (PX4, SET, False),
        (UNKNOWN, SET, False),
        (ARDUPILOT, {}, False),
        (ARDUPILOT, SET | {"EK3_SRC2_POSXY": 3.0}, False),
        (ARDUPILOT, SET | {"VISO_TYPE": 0.0}, False),
    ],
)
def test_only_an_ardupilot_whose_second_set_is_the_odometry_is_switched(
    autopilot: Autopilot, parameters: dict[str, float], can: bool
) -> None:
    assert can_switch(VehicleState(autopilot=autopilot), parameters) == can


# ---- over a link ----------------------------------------------------------------------------------------


class FakeLink:
    """Answers commands, and keeps them and the texts."""

    def __init__(self, outcome: Outcome) -> None:
        self.outcome = outcome
        self.connected = True
        self.inbox = SimpleNamespace(on_reboot=Event[[]]())
        self.vehicle = VehicleState(
            sysid=1, autopilot=ARDUPILOT, armed=True, health=Health(had_fix=True, fixless_since_ns=1)
        )
        self.commands: list[tuple[float, ...]] = []
        self.texts: list[str] = []

    async def command(self, command_id: int, *params: float, timeout_s: float, tries: int) -> CommandResult:
        assert timeout_s * tries < 2, "GPS is of use for seven seconds only"
        self.commands.append((command_id, *params))
        return CommandResult(command_id, self.outcome)

    def statustext(self, text: str, severity: int) -> None:
        self.texts.append(text)


def over_link(
    monkeypatch: pytest.MonkeyPatch, link: FakeLink, parameters: Callable[[], dict[str, float]]
) -> None:
    """Run for some turns."""
    monkeypatch.setattr(navigation_source, "TICK_S", 0.0)

    async def turns() -> None:
        task = asyncio.create_task(NavigationSource().run(cast(Link, link), lambda: True, parameters))
        for _ in range(20):
            await asyncio.sleep(0)
        task.cancel()

    asyncio.run(turns())


def test_the_command_is_that_of_the_source_set(monkeypatch: pytest.MonkeyPatch) -> None:
    link = FakeLink("accepted")
    over_link(monkeypatch, link, lambda: SET)
    assert link.commands == [(mavlink.MAV_CMD_SET_EKF_SOURCE_SET, 2.0)]
    assert link.texts == [f"SLZ: {LOST}"]


def test_nothing_is_commanded_on_the_ground_without_a_link_or_with_other_parameters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ground, silent, other = (FakeLink("accepted") for _ in range(3))
    ground.vehicle = replace(ground.vehicle, armed=False)
    silent.connected = False
    over_link(monkeypatch, ground, lambda: SET)
    over_link(monkeypatch, silent, lambda: SET)
    over_link(monkeypatch, other, dict)
    assert ground.commands == silent.commands == other.commands == []
