"""Output streams, message by message, without sockets or waiting, for each autopilot."""

from __future__ import annotations

import asyncio
import itertools
import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.landing.look_ahead import LEVEL_M, limit_velocity
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import OTHER, Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.link import Link
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.mapping import latest_report
from companion.flight.mapping import vehicle_surroundings as surroundings
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.mapping.recent_obstacles import RecentObstacles
from companion.flight.mapping.vehicle_surroundings import Surroundings
from companion.flight.mapping.window_pace import WindowPace
from companion.flight.outputs import schedule
from companion.flight.outputs.landing_status import Status
from companion.flight.outputs.schedule import Cadence, MessageSchedule
from companion.flight.services.settings import Settings
from companion.runtime.lockstep_loop import LockstepLoop
from params import Parameters
from slz import Nearby, Report, Scan, Wire
from slz.frame import LocalFrame
from slz.wires.detected_wire import SaggingCurve

S = 1_000_000_000
MS = 1_000_000
FRAME = LocalFrame(47.0, 8.0, 400.0)
BOOT_MS = 5000
STATUS = Status("idle", 0, math.nan, "none", math.nan, math.nan, math.nan, 0, math.nan)


class FakeLink:
    """Takes what is sent, over the wire's own encoding."""

    def __init__(self, autopilot: Autopilot) -> None:
        self.vehicle = VehicleState(
            sysid=1,
            autopilot=autopilot,
            boot_ms=BOOT_MS,
            position_lla=(47.0, 8.0, 410.0),
            velocity_ned_ms=(0.0, 0.0, 0.0),
            local_ned_m=(0.0, 0.0, -10.0),
        )
        self.sent: list[Any] = []
        self.handlers: dict[str, Any] = {}

    def subscribe(self, name: str, handler: Any) -> None:
        self.handlers[name] = handler

    def send(self, message: Any) -> None:
        wire = mavlink.MAVLink(None)
        self.sent.append(mavlink.MAVLink(None).parse_buffer(message.pack(wire))[0])

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.sent if message.get_type() == kind]


@dataclass
class Commands:
    """Holder of the landing point."""

    target_enu_m: NDArray[np.float64] | None = None


class Flight:
    """A vehicle 10 m above flat ground, facing east, with a tower 6 m north of it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, autopilot: Autopilot = ARDUPILOT) -> None:
        self.now_ns = 50 * S
        self.quat_wxyz = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
        for module in (schedule, surroundings, latest_report):
            monkeypatch.setattr(module, "now_ns", lambda: self.now_ns)
        self.link = FakeLink(autopilot)
        self.history = PoseHistory(Parameters(), FRAME)
        self.memory = RecentObstacles(thin=1)
        self.latest = LatestReport(Parameters(), WindowPace(Parameters()))
        self.around = Surroundings(self.memory, self.latest, Parameters())
        self.commands = Commands()
        self.streams = MessageSchedule(
            cast(Link, self.link), self.history, self.around, Parameters(), lambda: STATUS, self.commands
        )
        self.moves(0)

    def moves(self, after_ns: int, up_m: float = 10.0) -> None:
        """Let time pass, and the autopilot tell where it is now."""
        self.now_ns += after_ns
        self.history.add_attitude(self.now_ns, self.quat_wxyz, (0.0, 0.0, 0.0))
        lat, lon, alt = (float(v) for v in FRAME.lla([0.0, 0.0, up_m]))
        self.history.add_position(self.now_ns, lat, lon, alt, (0.0, 0.0, 0.0))

    def sees(self, points: NDArray[np.float64]) -> None:
        self.memory.add(Scan(points, np.full(len(points), self.now_ns), np.zeros(3), FRAME))

    def sees_ground(self, up_m: float = 0.0) -> None:
        around = np.random.default_rng(1).uniform(-2, 2, (500, 3))
        around[:, 2] = up_m
        self.sees(around)

    def maps(self, tower_m: float = 20.0, wires: tuple[Wire, ...] = ()) -> None:
        """Take a report of the flat ground with the tower, and of wires."""
        ground = np.zeros((80, 80), np.float32)
        top = ground.copy()
        top[52, 40] = tower_m
        report = object.__new__(Report)
        object.__setattr__(
            report, "nearby", Nearby(-20.25, -20.25, 0.5, ground, top, np.zeros(ground.shape, bool))
        )
        object.__setattr__(report, "selected", None)
        object.__setattr__(report, "near", SimpleNamespace(zones=()))
        object.__setattr__(report, "wires", wires)
        self.latest.use_report(report)


@pytest.fixture
def flight(monkeypatch: pytest.MonkeyPatch) -> Flight:
    return Flight(monkeypatch)


def test_ranges_that_came_from_the_autopilot_are_not_told_back_to_it(flight: Flight) -> None:
    link, around = cast(Link, flight.link), flight.around
    flight.streams = MessageSchedule(
        link, flight.history, around, Parameters(), lambda: STATUS, flight.commands, ranges=False
    )
    flight.maps()
    flight.sees_ground()
    flight.streams.send_obstacles()
    flight.streams.send_height()
    assert not flight.link.sent


def test_what_only_the_map_knows_is_told(flight: Flight) -> None:
    flight.maps()
    for _ in range(4):
        flight.moves(S)
        flight.sees_ground()
        flight.streams.send_obstacles()
        told = flight.link.of("OBSTACLE_DISTANCE")[-1].distances
        assert told[54] == pytest.approx(575, abs=1), "north is to the left of a vehicle that faces east"
        assert set(told[:50]) == {65535}


def wire(north_m: float, up_m: float) -> Wire:
    """Return a level wire from west to east."""
    curve = SaggingCurve(
        np.array([0.0, north_m]),
        np.array([1.0, 0.0]),
        np.array([up_m, 0.0, 0.0]),
        np.eye(3) * 1e-4,
        0.05,
        1.0,
    )
    return Wire(1, curve, -20.0, 20.0, -30.0, 30.0, (False, False), 30, 0, 0)


def test_a_wire_is_told_long_after_its_last_return(flight: Flight) -> None:
    """Ten seconds later the map's cells are too old, and returns are forgotten."""
    flight.maps(0.0, (wire(-8.0, 10.5),))
    flight.moves(10 * S)
    flight.sees_ground()
    flight.streams.send_obstacles()
    told = flight.link.of("OBSTACLE_DISTANCE")[-1].distances
    assert told[18] == pytest.approx(800, abs=5), "south is to the right of a vehicle that faces east"
    assert told[54] == 65535
    points = [m for m in flight.link.of("OBSTACLE_DISTANCE_3D") if abs(m.y - 8.0) < 0.1]
    assert points
    assert points[0].z == pytest.approx(-0.5, abs=0.05)


def test_a_wire_far_below_is_no_obstacle_at_the_height_of_the_vehicle(flight: Flight) -> None:
    flight.maps(0.0, (wire(-8.0, 3.0),))
    flight.moves(10 * S)
    flight.sees_ground()
    flight.streams.send_obstacles()
    assert flight.link.of("OBSTACLE_DISTANCE")[-1].distances[18] == 65535


def test_velocity_is_limited_before_a_wire_that_no_return_shows(flight: Flight) -> None:
    flight.maps(0.0, (wire(-8.0, 10.5),))
    flight.moves(10 * S)
    flight.sees_ground()
    pose = flight.history.latest(flight.now_ns)
    assert pose is not None
    around = flight.around.level_frd_m(pose, flight.now_ns, LEVEL_M)
    towards = np.array([0.0, 6.0, 0.0])
    limited = limit_velocity(towards, around, 1.0)
    assert 0.5 < limited.velocity_frd_ms[1] < 5.0
    assert limit_velocity(-towards, around, 1.0).velocity_frd_ms[1] == pytest.approx(-6.0)


def test_standing_the_ground_is_no_obstacle_but_the_sensor_is_alive(flight: Flight) -> None:
    for up_m in np.linspace(9.9, 0.1, 50):  # it sinks: a jump within a millisecond is the estimate's
        flight.moves(100 * MS, up_m=up_m)
    flight.sees_ground()
    flight.streams.send_obstacles()
    assert min(flight.link.of("OBSTACLE_DISTANCE")[-1].distances) < 200
    flight.link.vehicle = replace(flight.link.vehicle, reported_landed="on_ground")
    flight.streams.send_obstacles()
    assert set(flight.link.of("OBSTACLE_DISTANCE")[-1].distances) == {65535}


def test_an_old_map_says_nothing_of_what_stands_there_now(flight: Flight) -> None:
    flight.maps()
    flight.moves(6 * S)
    flight.sees_ground()
    flight.streams.send_obstacles()
    assert set(flight.link.of("OBSTACLE_DISTANCE")[-1].distances) == {65535}


def test_a_silent_lidar_is_not_hidden_by_the_map(flight: Flight) -> None:
    flight.maps()
    flight.sees_ground()
    flight.moves(S + MS)
    flight.streams.send_obstacles()
    flight.streams.send_height()
    assert flight.link.sent == []


def test_points_reach_ardupilot_only_each_batch_with_a_stamp_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = Flight(monkeypatch)
    flight.maps()
    flight.sees_ground()
    for _ in range(7):  # the autopilot's clock, as heard, stands still
        flight.streams.send_obstacles()
    points = flight.link.of("OBSTACLE_DISTANCE_3D")
    assert [(m.frame, m.time_boot_ms) for m in points] == [
        (12, BOOT_MS),
        (12, BOOT_MS + 1),
        (12, BOOT_MS + 2),
    ]
    assert (points[0].x, points[0].y, points[0].z) == pytest.approx((0, -6, 0), abs=0.01)
    kinds = [m.get_type() for m in flight.link.sent]
    assert all(b == "OBSTACLE_DISTANCE" for a, b in itertools.pairwise(kinds) if a == "OBSTACLE_DISTANCE_3D")
    px4 = Flight(monkeypatch, PX4)
    px4.maps()
    px4.sees_ground()
    px4.streams.send_obstacles()
    assert [m.get_type() for m in px4.link.sent] == ["OBSTACLE_DISTANCE"]


def test_the_height_is_told_without_a_target_and_a_car_below_counts_at_once(flight: Flight) -> None:
    flight.maps()
    flight.sees_ground()
    flight.streams.send_height()
    flight.moves(3 * S)
    flight.sees_ground(1.5)
    flight.streams.send_height()
    told = flight.link.of("DISTANCE_SENSOR")
    assert [(m.orientation, m.current_distance) for m in told] == [(25, 1000), (25, 850)]


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0, 30.0])
def test_the_height_is_told_as_a_rangefinder_on_the_vehicle_measures_it(
    flight: Flight, tilt_deg: float
) -> None:
    """The autopilots multiply what they hear by the cosine of the tilt."""
    half = math.radians(tilt_deg) / 2
    flight.quat_wxyz = (math.cos(half), math.sin(half), 0.0, 0.0)
    flight.moves(S, 10.0)
    flight.sees_ground()
    flight.streams.send_height()
    (message,) = flight.link.of("DISTANCE_SENSOR")
    told_m = message.current_distance / 100 * math.cos(math.radians(tilt_deg))
    assert told_m == pytest.approx(flight.streams.height_m, abs=0.01)


def test_an_unknown_height_is_not_told(flight: Flight) -> None:
    flight.sees(np.array([[30.0, 0.0, 0.0]]))
    flight.streams.send_height()
    assert flight.link.sent == []


@given(
    st.sampled_from([ARDUPILOT, PX4, OTHER]),
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.integers(1, 10**12),
)
def test_no_target_ever_steps_into_a_trap(
    autopilot: Autopilot, point: tuple[float, float, float], later_ns: int
) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        flight = Flight(monkeypatch, autopilot)
        flight.moves(later_ns)
        flight.commands.target_enu_m = np.array(point)
        flight.streams.send_target()
    (message,) = flight.link.sent
    frames = {PX4: mavlink.MAV_FRAME_LOCAL_NED}
    assert message.frame == frames.get(autopilot, mavlink.MAV_FRAME_BODY_FRD)
    assert message.position_valid == 1
    assert message.distance > 0
    assert message.time_usec == flight.now_ns // 1000 > BOOT_MS * 1000
    assert flight.link.of("LANDING_TARGET") == flight.link.sent


def test_a_target_on_the_vehicle_itself_keeps_a_distance(flight: Flight) -> None:
    flight.commands.target_enu_m = np.array([0.0, 0.0, 10.0])
    flight.streams.send_target()
    assert flight.link.sent[0].distance > 0


def test_without_a_target_or_a_fresh_pose_nothing_leads_the_vehicle(flight: Flight) -> None:
    flight.streams.send_target()
    flight.commands.target_enu_m = np.zeros(3)
    flight.now_ns += S
    flight.streams.send_target()
    assert flight.link.sent == []


def test_a_jump_of_the_estimate_forgets_map_and_returns(flight: Flight) -> None:
    flight.maps()
    flight.sees_ground()
    flight.latest.begin_map()
    flight.memory.forget()
    flight.streams.send_obstacles()
    flight.streams.send_height()
    assert flight.link.sent == []


def test_rates_are_kept_on_a_clock_that_only_the_loop_moves() -> None:
    steps = itertools.count(2 * MS, 2 * MS)
    loop = LockstepLoop(lambda: next(steps))
    parameters = Parameters()
    link = FakeLink(ARDUPILOT)
    link.vehicle = replace(link.vehicle, boot_ms=None)

    async def fly() -> dict[str, Any]:
        history, latest = PoseHistory(parameters, FRAME), LatestReport(parameters, WindowPace(parameters))
        around = Surroundings(RecentObstacles(), latest, parameters)
        target = Commands(np.zeros(3))
        sender = MessageSchedule(cast(Link, link), history, around, parameters, lambda: STATUS, target)
        task = asyncio.create_task(sender.run())
        for _ in range(250):
            now = schedule.now_ns()
            history.add_attitude(now, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            history.add_position(now, 47.0, 8.0, 410.0, (0.0, 0.0, 0.0))
            await asyncio.sleep(0.02)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return sender.statistics()

    try:
        told = loop.run_until_complete(fly())["LANDING_TARGET"]
    finally:
        loop.close()
    assert told["hz"] == pytest.approx(20, abs=0.2)
    assert told["jitter_ms"]["max"] <= 4
    assert told["pose_age_ms"]["max"] <= 22
    assert len(link.of("NAMED_VALUE_FLOAT")) in (4 * 5, 4 * 6)


def test_a_rate_that_is_set_in_flight_holds_from_the_next_message_on(flight: Flight) -> None:
    steps = itertools.count(2 * MS, 2 * MS)
    loop = LockstepLoop(lambda: next(steps))
    settings = Settings(Parameters())
    sent = []

    async def fly() -> None:
        history = PoseHistory(settings.live, FRAME)
        around = Surroundings(RecentObstacles(), flight.latest, settings.live)
        sender = MessageSchedule(
            cast(Link, flight.link), history, around, settings.live, lambda: STATUS, flight.commands
        )
        sender.send_obstacles = lambda: sent.append(loop.time())  # type: ignore[method-assign]
        task = asyncio.create_task(sender.run())
        await asyncio.sleep(2.0)
        assert settings.change("obstacle_hz", 2.0).accepted
        await asyncio.sleep(4.0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    try:
        loop.run_until_complete(fly())
    finally:
        loop.close()
    periods = np.diff(sent)
    assert np.median(periods[:20]) == pytest.approx(1 / 12, abs=0.005)
    assert np.median(periods[-6:]) == pytest.approx(0.5, abs=0.005)
    assert len(sent) == pytest.approx(2 * 12 + 4 * 2, abs=3)


@pytest.mark.parametrize(("odometry", "sends"), [("autopilot", True), ("map", False), ("off", False)])
def test_the_lidar_odometry_is_sent_if_the_autopilot_shall_use_it(
    flight: Flight, odometry: str, sends: bool
) -> None:
    newest = SimpleNamespace(estimate=None)
    flight.streams = MessageSchedule(
        cast(Link, flight.link),
        flight.history,
        flight.around,
        Parameters(odometry=odometry),
        lambda: STATUS,
        flight.commands,
        newest,
    )
    flight.link.vehicle = replace(flight.link.vehicle, armed=True)
    flight.streams.send_odometry()
    assert flight.link.sent == []
    for _ in range(3):
        flight.moves(100 * MS)
        at_ns, here = flight.now_ns - 200 * MS, np.array([1.0, 2.0, 10.0])
        quat = np.array(flight.quat_wxyz)
        newest.estimate = OdometryEstimate(
            at_ns, here, np.zeros(3), quat, 1e-4 * np.eye(6), 1e-4 * np.eye(3), np.ones(6, np.bool_), 0
        )
        flight.streams.send_odometry()
        flight.streams.send_odometry()
    told = flight.link.of("ODOMETRY")
    assert len(told) == (3 if sends else 0)
    assert flight.streams.statistics()["ODOMETRY"]["count"] == len(told)
    for message in told:
        assert (message.x, message.y, message.z) == pytest.approx((2, 1, -10), abs=1e-3)


# Statistics of a stream: its rate, the deviation of its intervals, the age of its poses.


def test_rate_jitter_and_age() -> None:
    cadence = Cadence(20.0)
    for at in (0, 50, 104, 150):
        cadence.record(at * MS, 15 * MS)
    assert cadence.summary() == {
        "count": 4,
        "hz": 20.0,
        "jitter_ms": {"p50": 4.0, "p99": 4.0, "max": 4.0},
        "pose_age_ms": {"p50": 15.0, "p99": 15.0, "max": 15.0},
    }


def test_a_pause_is_no_interval() -> None:
    cadence = Cadence(20.0)
    cadence.record(0)
    cadence.record(50 * MS)
    cadence.pause()
    cadence.record(9000 * MS)
    assert cadence.summary()["jitter_ms"]["max"] == 0


def test_what_was_never_sent_has_no_figures() -> None:
    assert Cadence(20.0).summary() == {"count": 0}
    assert "jitter_ms" not in Cadence(None).summary()


def test_messages_of_one_instant_have_no_rate() -> None:
    cadence = Cadence(20.0)
    cadence.record(5)
    cadence.record(5)
    assert cadence.summary() == {"count": 2}
