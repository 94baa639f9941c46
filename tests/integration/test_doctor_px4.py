"""The doctor beside a PX4, on simulated time."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import params
from companion.flight.doctor import examination
from companion.flight.doctor.examination import Examination
from companion.flight.doctor.finding import Finding
from tests.integration.link_bench import autopilot_over_udp, running, until, virtually
from tests.integration.px4_bench import LATER, OFFBOARD, Px4, good_values
from tests.ports import free_port


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the speed of the machine that runs the tests out of them."""
    monkeypatch.setattr(examination, "machine_findings", lambda parameters, late_ms: [])


def examined(**px4: Any) -> dict[str, Finding]:
    """Examine a PX4 on the bench; its LiDAR is silent."""
    found: list[Finding] = []

    async def examine() -> None:
        port = free_port()
        async with autopilot_over_udp(port, Px4, **px4):
            urls = f"udpin:127.0.0.1:{port}", f"livox:127.0.0.1:{free_port()}"
            found.extend(await Examination(*urls, params.load(), 20.0).run())

    virtually(examine)
    return {finding.check: finding for finding in found if not finding.check.startswith("LiDAR")}


@pytest.mark.parametrize("offers_mode", [True, False])
def test_a_px4_set_up_for_us_fails_nothing(offers_mode: bool) -> None:
    findings = examined(offers_mode=offers_mode)
    assert [finding for finding in findings.values() if finding.state in ("fail", "warn")] == []
    assert findings["rate of HEARTBEAT"].found in ("0.5 Hz", "1.0 Hz", "1.5 Hz")
    assert findings["rate of CURRENT_MODE"].state == ("ok" if offers_mode else "skipped")
    assert findings["firmware"].found == "PX4 1.17.0 release"
    assert not LATER & findings.keys()  # it has none, and needs none
    assert good_values().keys() <= findings.keys()


def test_px4_s_dangers_are_named() -> None:
    values = good_values() | {"COM_OBL_RC_ACT": 0.0, "EAV_EN": 1.0, "MAN_OVERRIDE_SPD": -1.0}
    findings = examined(values=values)
    assert (findings["COM_OBL_RC_ACT"].state, findings["COM_OBL_RC_ACT"].found) == ("fail", "0")
    assert (findings["EAV_EN"].state, findings["MAN_OVERRIDE_SPD"].state) == ("warn", "warn")


def test_lost_answers_are_asked_for_again_and_what_never_comes_is_told() -> None:
    findings = examined(lose={"COM_OBL_RC_ACT": 2, "PLD_BTOUT": 99}, version=None)
    assert findings["COM_OBL_RC_ACT"].state == "ok"
    assert (findings["PLD_BTOUT"].state, findings["PLD_BTOUT"].found) == ("fail", "could not be read")
    assert findings["firmware"].found == "PX4, version not told"


# The link with a PX4: no request that it does not support, and immediate detection of its mode.


INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


@pytest.mark.parametrize("offers_mode", [True, False])
def test_px4_refuses_at_most_one_request_once(offers_mode: bool) -> None:
    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, Px4, offers_mode=offers_mode) as autopilot,
        ):
            await until(lambda: link.connected)
            await asyncio.sleep(60)
            asked = [int(m.param1) for m in autopilot.heard("COMMAND_LONG") if m.command == INTERVAL]
            assert mavlink.MAVLINK_MSG_ID_HEARTBEAT not in asked
            assert asked.count(436) == 1
            statistics = link.statistics()
            assert statistics.missing == ()
            assert statistics.refused == (() if offers_mode else ("CURRENT_MODE",))
            assert statistics.unknown == statistics.bad == 0
            assert link.vehicle.mode == "AUTO.LOITER"

    virtually(flight)


@pytest.mark.parametrize(("offers_mode", "seconds"), [(True, 0.6), (False, 1.1)])
def test_a_change_of_the_mode_is_seen_as_soon_as_it_is_told(offers_mode: bool, seconds: float) -> None:
    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, Px4, offers_mode=offers_mode) as autopilot,
        ):
            await until(lambda: link.connected)
            await asyncio.sleep(10)
            autopilot.mode = OFFBOARD
            await until(lambda: link.vehicle.guided, seconds)

    virtually(flight)
