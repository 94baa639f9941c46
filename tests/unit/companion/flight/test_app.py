"""Execution of the executive's commands by the application, without sockets."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import params
from companion.flight import situation_source
from companion.flight.app import Companion
from companion.flight.landing.situation import Phase, VehicleCommands
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.command import CommandResult
from companion.flight.link.link import Link
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensing import Sources
from companion.flight.telling import Displays
from companion.runtime.clock import now_ns
from slz import LocalFrame, Scan
from tests.integration.link_bench import on_simulated_clock
from tests.ports import free_port
from tests.unit.companion.flight.landing.flight import Flight

FLYING = VehicleState(sysid=1, autopilot=ARDUPILOT, vehicle_type=2, armed=True, reported_landed="in_air")


class Cockpit:
    """A companion whose commands are given by the test, and what it sends."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.companion = Companion(
            "udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301"), params.load(), auto=False
        )
        self.vehicle = FLYING
        self.sent: list[Any] = []
        self.asked: list[str] = []
        self.ended: list[str] = []
        self.commands = VehicleCommands()
        monkeypatch.setattr(Link, "vehicle", property(lambda _link: self.vehicle))
        monkeypatch.setattr(self.companion.link, "send", self.sent.append)
        monkeypatch.setattr(self.companion.link, "set_mode", self._set_mode)
        monkeypatch.setattr(self.companion.executive, "step", lambda _situation: self.commands)
        self.companion.executive.progress.phase = Phase.CLIMB

    async def _set_mode(self, name: str) -> CommandResult:
        self.asked.append(name)
        try:
            await asyncio.sleep(60)  # no answer comes
        except asyncio.CancelledError:
            self.ended.append(name)
            raise
        return CommandResult(0, "timeout")

    async def tick(self, mode: str, heard_s_ago: float = 0.0) -> None:
        heard_ns = now_ns() - round(heard_s_ago * 1e9)
        self.vehicle = replace(FLYING, mode=mode, last_heartbeat_ns=heard_ns)
        self.companion.deciding.loop.run_once()
        await asyncio.sleep(0.01)

    def velocities(self) -> list[tuple[float, float, float]]:
        kind = "SET_POSITION_TARGET_LOCAL_NED"
        return [(m.vx, m.vy, m.vz) for m in self.sent if m.get_type() == kind]


@asynccontextmanager
async def cockpit(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Cockpit]:
    made = Cockpit(monkeypatch)
    yield made
    made.companion.deciding.modes.cancel()
    made.companion.mapping.worker.close()


@pytest.mark.parametrize(("mode", "heard_s_ago"), [("GUIDED", 0.0), ("LAND", 3.0)])
@on_simulated_clock
async def test_a_mode_is_asked_for_no_more_once_reached_or_nothing_is_heard(
    monkeypatch: pytest.MonkeyPatch, mode: str, heard_s_ago: float
) -> None:
    """A try after that would undo what the pilot chose in between."""
    async with cockpit(monkeypatch) as seat:
        seat.commands = VehicleCommands(mode="guided", velocity_enu_ms=np.zeros(3))
        await seat.tick("LAND")
        assert seat.asked == ["GUIDED"]
        seat.commands = VehicleCommands(velocity_enu_ms=np.zeros(3))
        await seat.tick("LAND")
        assert not seat.ended
        await seat.tick(mode, heard_s_ago)
        assert seat.ended == ["GUIDED"]


@pytest.mark.parametrize("phase", [Phase.CLIMB, Phase.HOLD, Phase.SURVEY, Phase.APPROACH])
@on_simulated_clock
async def test_the_landing_mode_is_asked_for_no_more_once_the_landing_is_broken_off(
    monkeypatch: pytest.MonkeyPatch, phase: Phase
) -> None:
    """A try after that would land the vehicle where it is."""
    async with cockpit(monkeypatch) as seat:
        seat.companion.executive.progress.phase = Phase.FINAL
        seat.commands = VehicleCommands(mode="land")
        await seat.tick("GUIDED")
        seat.commands = VehicleCommands()
        await seat.tick("GUIDED")
        assert not seat.ended
        seat.companion.executive.progress.phase = phase
        await seat.tick("GUIDED")
        assert seat.ended == ["LAND"]


@on_simulated_clock
async def test_the_guided_mode_is_asked_for_no_more_once_the_landing_is_watched_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A try after that would look like a mode of the pilot's, in the last metres."""
    async with cockpit(monkeypatch) as seat:
        seat.commands = VehicleCommands(mode="guided")
        await seat.tick("LAND")
        seat.commands = VehicleCommands()
        await seat.tick("LAND")
        assert not seat.ended
        seat.companion.executive.progress.phase = Phase.FINAL
        await seat.tick("LAND")
        assert seat.ended == ["GUIDED"]


@on_simulated_clock
async def test_the_stop_is_the_last_setpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    """ArduPilot flies on for three seconds with the last velocity that it was given."""
    async with cockpit(monkeypatch) as seat:
        companion = seat.companion
        await seat.tick("GUIDED")
        seat.commands = VehicleCommands(velocity_enu_ms=np.array([4.0, 0.0, 0.0]))
        stop = asyncio.Event()
        deciding = asyncio.create_task(companion.deciding.loop.run(stop))
        await asyncio.sleep(0.12)
        stop.set()
        await companion.leave()
        deciding.cancel()
        assert seat.velocities()[0] == (0.0, 4.0, 0.0)
        assert seat.velocities()[-1] == (0.0, 0.0, 0.0)


@on_simulated_clock
async def test_a_mode_that_is_refused_is_asked_for_again_each_second(monkeypatch: pytest.MonkeyPatch) -> None:
    async with cockpit(monkeypatch) as seat:

        async def refuse(name: str) -> CommandResult:
            seat.asked.append(name)
            return CommandResult(0, "denied", 1)

        monkeypatch.setattr(seat.companion.link, "set_mode", refuse)
        monkeypatch.setattr("companion.flight.mode_requests.ASK_AGAIN_S", 0.2, raising=False)
        seat.commands = VehicleCommands(mode="guided")
        for _ in range(10):
            await seat.tick("LOITER")
        assert len(seat.asked) == 1
        await asyncio.sleep(0.2)
        await seat.tick("LOITER")
        assert len(seat.asked) == 2


@pytest.mark.parametrize(
    ("window_s", "age_s", "fresh"), [(1.0, 2.9, True), (1.0, 3.1, False), (2.0, 3.9, True)]
)
@on_simulated_clock
async def test_reports_may_come_as_seldom_as_the_adapted_window_makes_them(
    monkeypatch: pytest.MonkeyPatch, window_s: float, age_s: float, fresh: bool
) -> None:
    """The pipeline gathers up to two seconds where returns are few."""
    async with cockpit(monkeypatch) as seat:
        seat.companion.mapping.worker.pace.window_s = window_s
        report = Flight([]).situation().report
        assert report is not None
        latest = seat.companion.mapping.latest
        latest.use_report(report)
        assert (latest.fresh(now_ns() + round(age_s * 1e9)) is report) is fresh


@pytest.mark.parametrize(
    ("lidar_s", "seen_s", "fresh"),
    [(0.1, 0.1, True), (1.9, 0.1, False), (None, 0.1, False), (0.1, 1.9, False)],
)
@on_simulated_clock
async def test_a_radar_sees_for_a_blind_lidar_and_not_for_a_silent_one(
    lidar_s: float | None, seen_s: float, fresh: bool
) -> None:
    """In dust the LiDAR sends packets without a return; one whose cable broke sends none."""
    companion = Companion(
        "udpin:127.0.0.1:14550",
        Sources("livox:127.0.0.1:56301", "radar:127.0.0.1:7611"),
        params.load("quadcopter", ["lidar_timeout_s=1"]),
        auto=False,
    )
    now = now_ns()
    companion.mapping.feed.last_scan_ns = now - round(seen_s * 1e9)
    companion.sensing.lidar.stream.last_arrival_ns = None if lidar_s is None else now - round(lidar_s * 1e9)  # type: ignore[attr-defined]
    assert companion.deciding.situations.scans_are_fresh(now) is fresh
    companion.mapping.worker.close()


ON_PX4 = replace(FLYING, autopilot=PX4, local_ned_m=(3.0, -4.0, -12.0), local_boot_ms=9_900, boot_ms=10_000)
VELOCITIES, PLACE = 0b000111000, 0b000000111  # what a mask of the message ignores
ACCELERATIONS = 0b111000000


@on_simulated_clock
async def test_px4_gets_setpoints_before_its_offboard_mode_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It enters that mode only while they arrive; few are enough, and on the ground none are due."""
    async with cockpit(monkeypatch) as seat:
        monkeypatch.setattr(f"{__name__}.FLYING", ON_PX4)
        await seat.tick("AUTO.LOITER")
        await seat.tick("AUTO.LOITER")
        assert len(seat.velocities()) == 1
        monkeypatch.setattr(f"{__name__}.FLYING", replace(ON_PX4, reported_landed="on_ground"))
        monkeypatch.setattr(situation_source, "now_ns", lambda: now_ns() + 10**9)  # the next one is due
        await seat.tick("AUTO.LOITER")
        assert len(seat.velocities()) == 1


@pytest.mark.parametrize("mode", ["POSCTL", "AUTO.MISSION", "AUTO.LOITER", "AUTO.RTL"])
@on_simulated_clock
async def test_px4_is_told_no_velocity_in_a_mode_of_the_pilot(
    monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    """A version that mixes a companion's velocities into Position mode and missions would be braked."""
    async with cockpit(monkeypatch) as seat:
        monkeypatch.setattr(f"{__name__}.FLYING", ON_PX4)
        await seat.tick(mode)
        (signal,) = [m for m in seat.sent if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
        assert signal.type_mask & VELOCITIES == VELOCITIES
        assert signal.type_mask & ACCELERATIONS == ACCELERATIONS
        assert signal.type_mask & PLACE == 0  # all ignored would not open OFFBOARD
        assert (signal.x, signal.y, signal.z) == (3.0, -4.0, -12.0)


@on_simulated_clock
async def test_px4_is_told_to_stop_in_offboard_until_an_order_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    async with cockpit(monkeypatch) as seat:
        monkeypatch.setattr(f"{__name__}.FLYING", ON_PX4)
        await seat.tick("OFFBOARD")
        (signal,) = [m for m in seat.sent if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
        assert (signal.vx, signal.vy, signal.vz) == (0.0, 0.0, 0.0)
        assert signal.type_mask & VELOCITIES == 0
        assert signal.type_mask & PLACE == PLACE


@pytest.mark.parametrize("stale", [{"local_ned_m": None}, {"local_boot_ms": 9_000}])
@on_simulated_clock
async def test_px4_is_told_no_place_that_is_not_its_own(
    monkeypatch: pytest.MonkeyPatch, stale: dict[str, Any]
) -> None:
    async with cockpit(monkeypatch) as seat:
        monkeypatch.setattr(f"{__name__}.FLYING", replace(ON_PX4, **stale))
        await seat.tick("AUTO.LOITER")
        assert seat.velocities() == []


@pytest.mark.parametrize(("heard_s_ago", "known"), [(1.0, True), (2.1, True), (2.6, False)])
@on_simulated_clock
async def test_the_mode_is_known_at_one_heartbeat_a_second_of_which_one_is_lost(
    monkeypatch: pytest.MonkeyPatch, heard_s_ago: float, known: bool
) -> None:
    """PX4's heartbeat cannot be made faster."""
    async with cockpit(monkeypatch) as seat:
        monkeypatch.setattr(f"{__name__}.FLYING", ON_PX4)
        await seat.tick("OFFBOARD", heard_s_ago)
        assert seat.companion.deciding.situations.situation().heard is known


def scan(stamp_ns: int) -> Scan:
    points = np.array([[1.0, 2.0, -20.0], [2.0, 2.0, -20.0]])
    return Scan(points, np.full(2, stamp_ns), np.zeros(3), LocalFrame(47.0, 8.0, 400.0))


@on_simulated_clock
async def test_the_first_scan_after_a_jump_of_the_estimate_begins_a_new_map(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async with cockpit(monkeypatch) as seat:
        companion, begun, offered = seat.companion, [], []
        monkeypatch.setattr(companion.mapping.worker, "reset", lambda: begun.append("map"))
        monkeypatch.setattr(companion.mapping.worker, "add_scan", lambda scan, _number: offered.append(scan))
        companion.link.ready = True
        companion.mapping.feed.add_lidar_scan(scan(1))
        companion.mapping.feed.add_radar_scan(scan(2))
        assert (len(begun), len(offered)) == (0, 2)
        companion.sensing.history.epoch += 1
        companion.mapping.feed.add_radar_scan(scan(3))  # it may still be of the frame before
        assert (len(begun), len(offered)) == (0, 2)
        companion.mapping.feed.add_lidar_scan(scan(4))
        companion.mapping.feed.add_radar_scan(scan(5))
        assert (len(begun), len(offered)) == (1, 3)
        assert "the position estimate jumped: mapping anew" in caplog.text


@on_simulated_clock
async def test_a_point_selected_after_a_jump_is_selected_in_the_new_map(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else the map's end would take the point that the executive has just moved with the estimate."""
    async with cockpit(monkeypatch) as seat:
        companion, point, done, offered = seat.companion, np.array([1.0, 2.0, 0.0]), [], []
        monkeypatch.setattr(companion.mapping.worker, "reset", lambda: done.append("map"))
        monkeypatch.setattr(companion.mapping.worker, "select", lambda _point: done.append("point"))
        monkeypatch.setattr(companion.mapping.worker, "add_scan", lambda scan, _number: offered.append(scan))
        companion.link.ready = True
        seat.commands = VehicleCommands(select_enu_m=point)
        companion.sensing.history.epoch += 1
        await seat.tick("GUIDED")
        companion.mapping.feed.add_lidar_scan(scan(1))  # it may still be of the frame before
        assert (done, offered) == (["map", "point"], [])
        companion.mapping.feed.add_lidar_scan(scan(2))
        assert (done, len(offered)) == (["map", "point"], 1)


@on_simulated_clock
async def test_a_reboot_of_the_autopilot_begins_a_new_map(monkeypatch: pytest.MonkeyPatch) -> None:
    async with cockpit(monkeypatch) as seat:
        begun: list[str] = []
        monkeypatch.setattr(seat.companion.mapping.worker, "reset", lambda: begun.append("map"))
        seat.companion.mapping.feed.add_lidar_scan(scan(1))
        seat.companion.link.inbox.on_reboot.emit()
        seat.companion.mapping.feed.add_lidar_scan(scan(2))
        assert begun == ["map"]


@on_simulated_clock
async def test_nothing_is_mapped_before_the_kernels_are_warm(monkeypatch: pytest.MonkeyPatch) -> None:
    async with cockpit(monkeypatch) as seat:
        offered: list[Scan] = []
        monkeypatch.setattr(
            seat.companion.mapping.worker, "add_scan", lambda scan, _number: offered.append(scan)
        )
        seat.companion.link.ready = False
        seat.companion.mapping.feed.add_lidar_scan(scan(1))
        assert offered == []
        seat.companion.link.ready = True
        seat.companion.mapping.feed.add_lidar_scan(scan(2))
        assert len(offered) == 1


@on_simulated_clock
async def test_a_radar_and_a_view_run_and_end_with_the_companion(monkeypatch: pytest.MonkeyPatch) -> None:
    async def warm_up() -> None: ...

    ports = [free_port() for _ in range(3)]
    companion = Companion(
        f"udpin:127.0.0.1:{ports[0]}",
        Sources(f"livox:127.0.0.1:{ports[1]}", f"radar:127.0.0.1:{ports[2]}"),
        params.load(),
        auto=False,
        displays=Displays(foxglove_port=0),
    )
    monkeypatch.setattr(companion.mapping.worker, "warm_up", warm_up)
    companion.on_ready.subscribe(companion.stop)
    await companion.run()
    assert companion.telling.live is not None
    assert companion.summary["phase"] == "idle"
    assert companion.summary["radar"]["packets"] == 0
    with pytest.raises(ConnectionRefusedError):  # nobody listens any more
        await asyncio.open_connection("127.0.0.1", companion.telling.live.port)


@pytest.mark.parametrize(
    ("autopilot", "kind", "vtol_state", "mode"),
    [
        (PX4, 1, 0, "OFFBOARD"),
        (PX4, 22, 4, "OFFBOARD"),
        (PX4, 22, 3, "AUTO.LOITER"),
        (ARDUPILOT, 2, 4, "GUIDED"),
    ],
)
@on_simulated_clock
async def test_a_vehicle_that_must_not_be_commanded_gets_nothing_whatever_is_decided(
    monkeypatch: pytest.MonkeyPatch, autopilot: Autopilot, kind: int, vtol_state: int, mode: str
) -> None:
    """No mode, velocity or target, nor the signal that keeps PX4's OFFBOARD open, nor a last stop."""
    async with cockpit(monkeypatch) as seat:
        flying = replace(ON_PX4, autopilot=autopilot, vehicle_type=kind, vtol_state=vtol_state)
        monkeypatch.setattr(f"{__name__}.FLYING", replace(flying, vtol_heard_ns=now_ns() - 10**10))
        seat.commands = VehicleCommands(
            mode="guided", velocity_enu_ms=np.array([4.0, 0.0, 0.0]), target_enu_m=np.zeros(3)
        )
        await seat.tick(mode)
        seat.commands = VehicleCommands()
        await seat.tick(mode)
        await seat.companion.leave()
        assert (seat.velocities(), seat.asked, seat.companion.deciding.execution.target_enu_m) == (
            [],
            [],
            None,
        )
