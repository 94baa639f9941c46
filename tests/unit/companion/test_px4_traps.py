"""Commands that PX4 acknowledges but executes otherwise are never sent (docs/mavlink.md)."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import companion
import params
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase, VehicleCommands
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.command import CommandResult
from companion.flight.link.link import Link
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensing import Sources
from companion.runtime.clock import now_ns

IN_FLIGHT = VehicleState(
    sysid=1,
    autopilot=PX4,
    vehicle_type=2,
    armed=True,
    mode="OFFBOARD",
    reported_landed="in_air",
    boot_ms=90_000,
)
# Setting a mode, asking for streams, and the operator's orders to ourselves.
KNOWN = {
    "MAV_CMD_DO_SET_MODE",
    "MAV_CMD_REQUEST_MESSAGE",  # for the version, by the doctor alone
    "MAV_CMD_SET_EKF_SOURCE_SET",  # to ArduPilot alone
    "MAV_CMD_SET_MESSAGE_INTERVAL",
    "MAV_CMD_USER_1",
}
# Never sent: items of the fence, which are read, and the order of others that is noticed.
READ = {
    "MAV_CMD_DO_REPOSITION",
    "MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION",
    "MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION",
    "MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION",
    "MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION",
    "MAV_CMD_NAV_FENCE_RETURN_POINT",
}


@pytest.fixture
def on_px4(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Companion, list[Any]]]:
    """Return a companion on a flying PX4, and what it sends."""
    made = Companion("udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301"), params.load(), auto=False)
    sent: list[Any] = []
    monkeypatch.setattr(made.link, "send", sent.append)

    async def command(command_id: int, *params: float, **_: Any) -> CommandResult:
        sent.append(SimpleNamespace(command=command_id, params=params))
        return CommandResult(command_id, "timeout")

    monkeypatch.setattr(made.link, "command", command)
    made.executive.progress.phase = Phase.FINAL
    yield made, sent
    made.mapping.worker.close()


def tick(made: Companion, monkeypatch: pytest.MonkeyPatch, commands: VehicleCommands) -> None:
    """Let the application carry out commands."""
    monkeypatch.setattr(made.executive, "step", lambda _situation: commands)
    vehicle = replace(IN_FLIGHT, last_heartbeat_ns=now_ns())
    monkeypatch.setattr(Link, "vehicle", property(lambda _link: vehicle))
    made.deciding.loop.run_once()


@pytest.mark.parametrize(("kind", "numbers"), [("land", (4.0, 9.0)), ("guided", (6.0, 0.0))])
async def test_it_lands_by_the_mode_not_by_the_command(
    on_px4: tuple[Companion, list[Any]], monkeypatch: pytest.MonkeyPatch, kind: Any, numbers: Any
) -> None:
    """NAV_LAND with a precision landing asked for is acknowledged and lands on the spot."""
    made, sent = on_px4
    tick(made, monkeypatch, VehicleCommands(mode=kind, velocity_enu_ms=np.zeros(3)))
    await asyncio.sleep(0)
    made.deciding.modes.cancel()
    (command,) = [message for message in sent if not hasattr(message, "get_type")]
    assert command.command == mavlink.MAV_CMD_DO_SET_MODE
    assert command.params[:3] == (1.0, *numbers)


def test_no_other_command_is_known_to_the_companion() -> None:
    """DO_REPOSITION flies to its height above the sea, whatever frame it was sent with."""
    sources = Path(companion.__file__).parent.rglob("*.py")
    found = {name for path in sources for name in re.findall(r"MAV_CMD_\w+", path.read_text("utf-8"))}
    assert found == KNOWN | READ


async def test_setpoints_are_velocities_of_the_local_frame(
    on_px4: tuple[Companion, list[Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    made, sent = on_px4
    tick(made, monkeypatch, VehicleCommands(velocity_enu_ms=np.array([0.0, 0.0, -1.0])))
    (setpoint,) = sent
    assert setpoint.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert setpoint.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert setpoint.vz == 1.0
