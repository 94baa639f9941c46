"""A flight whose place a ROS 2 odometry tells: over ground that tells a LiDAR nothing, GPS is cut."""

from __future__ import annotations

import asyncio
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from companion.desk.replay import replay_run
from companion.desk.replay import replay_run as replay
from companion.flight.app import Companion
from companion.flight.fusion import pose_history
from companion.flight.fusion.external_odometry.odometry_topic import OdometryTopic
from companion.flight.landing.situation import Phase
from companion.flight.rmw.zenoh_url import ZenohUrl
from companion.flight.sensing import Sources
from sitl import faults
from sitl.simulation import Simulation
from slz import LocalFrame
from tests.bench.landings import AIDED
from tests.e2e.brief import brief
from tests.e2e.harness import Mission
from tests.unit.companion.flight.fusion.external_odometry.odometry_messages import Told

pytestmark = pytest.mark.long

BEGUN_NS = 1_700_000_000_000_000_000
PERIOD_NS, WORK_NS = 100_000_000, 60_000_000
# The node's first pose was its origin: 140 degrees about up and some off level from the world.
FRAME = Rotation.from_euler("zyx", [140.0, 4.0, -3.0], degrees=True)
ORIGIN_M = np.array([3.0, -2.0, 0.5])
JUMP_M, JUMPS_BELOW_M = np.array([2.0, -1.0, 0.3]), 7.0
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])


async def _wait() -> None:
    await asyncio.get_running_loop().create_future()


class WithOdometry(Mission):
    """A mission whose companion takes an odometry; messages are handed over as by the subscription."""

    def new_companion(self) -> Companion:
        companion = Companion(
            f"udpin:127.0.0.1:{self.mavlink_port}",
            Sources(self.lidar, ros2=ZenohUrl(), odometry=OdometryTopic("/odom")),
            self.parameters,
            auto=self.auto,
            record=self.record,
        )
        node = companion.telling.ros_node
        assert node is not None
        node.run = _wait  # type: ignore[method-assign]  # no network: its threads know no simulated clock
        return companion


class Node:
    """An odometry that does not drift, 10 Hz, 60 ms late; it jumps once, as by a loop closure."""

    def __init__(self, mission: WithOdometry) -> None:
        self._mission = mission
        self._rng = np.random.default_rng(1)
        self._waiting: list[tuple[int, Told]] = []
        self._jump_m = np.zeros(3)
        self.sent = 0
        self.error_m: list[tuple[float, float]] = []  # of the place on the map, and of the autopilot's

    def on_tick(self, simulation: Simulation) -> None:
        subscription = self._mission.companion.sensing.ros_odometry
        assert subscription is not None
        now_ns = round(self._mission.loop.time() * 1e9)
        if simulation.now_ns % PERIOD_NS == 0:
            self._waiting.append((now_ns + WORK_NS, self._told(simulation, now_ns)))
            self._note(simulation, now_ns)
        while self._waiting and self._waiting[0][0] <= now_ns:
            subscription.stream.add_packet(self._waiting.pop(0)[1].packet(), now_ns)

    def _told(self, simulation: Simulation, now_ns: int) -> Told:
        truth = simulation.vehicle.truth
        if simulation.autopilot.armed and self.sent > 150 and self._mission.height_m < JUMPS_BELOW_M:
            self._jump_m = JUMP_M
        self.sent += 1
        body = Rotation.from_quat(truth.quat_wxyz[[1, 2, 3, 0]]).as_matrix()
        flu = Rotation.from_matrix(ENU_FROM_NED @ body @ FRD_FROM_FLU)
        place = FRAME.inv().apply(truth.pos_enu_m - ORIGIN_M) + self._rng.normal(0, 0.01, 3) + self._jump_m
        turn = (FRAME.inv() * flu).as_quat()
        return Told(BEGUN_NS + now_ns, tuple(place), tuple(turn), number=self.sent)

    def _note(self, simulation: Simulation, now_ns: int) -> None:
        history, truth = self._mission.companion.sensing.history, simulation.vehicle.truth.pos_enu_m
        pose, frame = history.latest(now_ns), history.frame
        if pose is None or frame is None or not simulation.autopilot.armed:
            return
        off = simulation.autopilot.enu_m(*frame.lla(pose.position_enu_m)) - truth
        plain = simulation.autopilot.enu_m(*frame.lla(history.correction.of_map(pose.position_enu_m))) - truth
        self.error_m.append((float(np.hypot(*off[:2])), float(np.hypot(*plain[:2]))))


@pytest.mark.timeout(600)
def test_without_gps_it_lands_by_an_odometry_that_jumps_and_again_in_the_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = tmp_path / "flight.mcap"
    mission = WithOdometry("plain", seed=3, record=recording, odometry="autopilot", **brief(parameters=AIDED))
    clock = SimpleNamespace(time_ns=lambda: BEGUN_NS + round(mission.loop.time() * 1e9))
    monkeypatch.setattr("companion.runtime.clock.time", clock)
    node = Node(mission)
    mission.sim.every_tick.extend([*faults.read("gps_denied@10.5", 1), node.on_tick])

    async def script(m: Mission) -> None:
        await m.until_phase(Phase.LANDED)
        await m.until(lambda: not m.sim.autopilot.armed, 10)

    mission.fly(script)
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() <= 0.5
    told = mission.companion.summary["odometry"]
    assert told["restarts"] == told["other_clock"] == told["malformed"] == 0
    assert (told["alignments"], told["jumps"]) == (1, 1)
    assert any("GPS lost: going on by the odometry" in text for text in mission.heard)
    assert any("odometry used" in text for text in mission.heard)
    assert not any("take over" in text for text in mission.heard)
    again = replay.run(recording, [], None, 0.0, (0.0, 1e9))
    assert again["identical"] == again["windows"] == mission.companion.mapping.worker.reports > 20


# Flight with a change of the map's frame: landing at the chosen point, and bit-exact replay.


A_STEP_RAD = 3e-8  # 0.2 m: what a climbing vehicle drifts


def test_frames_that_begin_before_the_hand_over_change_neither_the_landing_nor_its_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pose_history, "MOST_TURN_RAD", A_STEP_RAD)
    frames: list[LocalFrame | None] = []

    async def flight(mission: Mission) -> None:
        for phase in (Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL):
            await mission.until_phase(phase)
            frames.append(mission.companion.sensing.history.frame)
        await mission.until_phase(Phase.LANDED)

    mission = Mission(record=tmp_path / "flight.mcap", **brief()).fly(flight)
    assert sum("far from the map's origin" in text for text in mission.heard) >= 2
    assert len(set(frames)) == 1  # that of the hand-over
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() < 0.5
    again = replay_run.run(tmp_path / "flight.mcap", [], None, 0.0, (0.0, 1e9))
    assert again["windows"] - 1 <= again["identical"] > 10  # a frame may begin while a window is computed
    assert (again["different"], again["without_scans"], again["unreadable_messages"]) == (0, 0, 0)
    assert (again["lost_messages"], again["cut"]) == (0, "")
    assert again["zones"] == mission.companion.summary["zones"]
