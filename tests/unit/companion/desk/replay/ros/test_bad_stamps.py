"""Every message of a bag that is read, with bad stamps, first and amidst good ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import numpy as np
import pytest

from companion.desk.replay.foreign_replay import Rerun
from companion.desk.replay.ros.ros_feed import RosFeed
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.sensors.returns import Returns
from params import load
from slz import LocalFrame, Scan
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME, LIVOX

CLOUD = "sensor_msgs/msg/PointCloud2"
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
ESTIMATE = "geometry_msgs/msg/PoseWithCovarianceStamped"
FIX, IMU = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu"
SWEEPS, PERIOD_MS, POSE_MS, LATE_NS = 24, 100, 40, 115_000_000
AFTER_NS = np.linspace(0, 97_000_000, 50).round().astype(np.int64)
S = 10**9
MESSAGES = {"first": range(3), "amidst": range(15, 18)}

BAD: dict[str, Callable[[int], int]] = {
    "zero": lambda _: 0,
    "of a simulation": lambda stamp_ns: stamp_ns - BEGIN_NS + 12 * S,
    "before 1970": lambda stamp_ns: -5 * S + stamp_ns % S,
    "a year late": lambda stamp_ns: stamp_ns - 31_536_000 * S,
    "since 1900": lambda stamp_ns: stamp_ns % S,
    "of 2036": lambda stamp_ns: stamp_ns - BEGIN_NS + 2_085_978_496 * S,
    "the greatest": lambda _: 2_147_483_647 * S + 999_999_999,
}


BAD_OFFSETS_NS: dict[str, Callable[[int], int]] = {
    "zero": lambda _: 0,
    "since the sensor's start": lambda after_ns: after_ns + 3 * S,
    "in microseconds": lambda after_ns: after_ns // 1000,
    "before the timebase": lambda after_ns: (after_ns - 2 * S) % 2**32,
    "the greatest": lambda _: 2**32 - 1,
}


@dataclass
class Flight:
    """Takes the place of a `Rerun`, and keeps the returns and scans."""

    frame: LocalFrame | None = None
    scans: list[Scan] = field(default_factory=list)
    batches: list[Returns] = field(default_factory=list)

    def __post_init__(self) -> None:
        mount = [f"lidar_{name}=0" for name in ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")]
        self.parameters = load("quadcopter", mount)
        self.history = PoseHistory(self.parameters, self.frame)
        self.assembler = ScanAssembler(self.parameters, self.history, self.scans.append)

    def add_returns(self, returns: Returns) -> None:
        if len(returns):
            self.batches.append(returns)
            self.assembler.add(returns)


def messages(
    poses: str, kind: str = CLOUD, sweeps: int = SWEEPS
) -> dict[str, tuple[str, list[tuple[int, int, Any]]]]:
    """Return topic, type, and times of recording and stamps with what makes the message of a stamp."""
    points = np.full((len(AFTER_NS), 3), [1.0, 2.0, -20.0], np.float32)
    begins = [BEGIN_NS + k * PERIOD_MS * 10**6 for k in range(sweeps)]
    cloud = flights.livox_cloud if kind == LIVOX else flights.cloud
    clouds = [(begin + LATE_NS, begin, cloud(points, AFTER_NS, begin)) for begin in begins]
    stamps = range(-200, sweeps * PERIOD_MS + 200, POSE_MS)
    kinds = {"/fix": FIX, "/imu": IMU} if poses == FIX else {"/pose": poses}
    lines = {
        topic: (
            told,
            [(BEGIN_NS + ms * 10**6, BEGIN_NS + ms * 10**6, flights.pose(told, ms)) for ms in stamps],
        )
        for topic, told in kinds.items()
    }
    return {"/points": (kind, clouds)} | lines


def fly(path: Path, lines: dict[str, tuple[str, list[tuple[int, int, Any]]]]) -> tuple[Flight, RosFeed]:
    for _, entries in lines.values():
        for _, stamp_ns, message in entries:
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, S)
    flights.write_messages(
        path,
        {
            topic: (kind, [(at, message) for at, _, message in all_of])
            for topic, (kind, all_of) in lines.items()
        },
    )
    feed = RosFeed(path, None, ())
    flight = Flight(HOME if feed.is_local else None)
    for _, act in feed.steps(cast(Rerun, flight)):
        act()
    flight.assembler.finish()
    return flight, feed


def placed(flight: Flight) -> dict[int, np.ndarray]:
    """Return the points on the Earth by their stamps."""
    return {
        stamp_ns: place
        for scan in flight.scans
        for stamp_ns, place in zip(
            scan.stamp_ns.tolist(), HOME.enu_m(*scan.frame.lla(scan.points_enu_m).T), strict=True
        )
    }


@cache
def undisturbed(poses: str, clouds: str = CLOUD) -> dict[int, np.ndarray]:
    with TemporaryDirectory() as folder:
        return placed(fly(Path(folder) / "good", messages(poses, clouds))[0])


def check_places(flight: Flight, wanted: dict[int, np.ndarray], most_sweeps_lost: int = 8) -> None:
    """See that points are where they would be in a recording without faults, and how many are missing."""
    found = placed(flight)
    assert set(found) <= set(wanted)
    assert len(found) >= len(wanted) - most_sweeps_lost * len(AFTER_NS)
    assert max(float(np.linalg.norm(found[at] - wanted[at])) for at in found) < 0.05


READ = [
    (ODOMETRY, CLOUD, "/points"),
    (ODOMETRY, CLOUD, "/pose"),
    (POSE, CLOUD, "/pose"),
    (ESTIMATE, CLOUD, "/pose"),
    (FIX, CLOUD, "/fix"),
    (FIX, CLOUD, "/imu"),
    (ODOMETRY, LIVOX, "/points"),
]


def in_turn(*several: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Return all combinations, each at one of the two places of `MESSAGES`, in turn."""
    return [(*one, list(MESSAGES)[k % 2]) for k, one in enumerate(product(*several))]


@pytest.mark.parametrize(("read", "stamp", "where"), in_turn(READ, BAD))
def test_bad_stamps_cost_themselves_alone(
    tmp_path: Path, read: tuple[str, str, str], stamp: str, where: str
) -> None:
    poses, clouds, topic = read
    lines = messages(poses, clouds)
    entries = lines[topic][1]
    for k in MESSAGES[where]:
        entries[k] = entries[k][0], BAD[stamp](entries[k][1]), entries[k][2]
    flight, _ = fly(tmp_path / "bad", lines)
    check_places(flight, undisturbed(poses, clouds))
    assert where == "first" or flight.history.epoch == 0


@pytest.mark.parametrize(("stamp", "where"), in_turn(BAD))
def test_a_bad_timebase_of_livox_costs_nothing(tmp_path: Path, stamp: str, where: str) -> None:
    """Offsets count from the header's stamp, which drivers write from the timebase."""
    lines = messages(ODOMETRY, LIVOX)
    for k in MESSAGES[where]:
        _, stamp_ns, message = lines["/points"][1][k]
        message.timebase = BAD[stamp](stamp_ns) % 2**64
    check_places(fly(tmp_path / "bad", lines)[0], undisturbed(ODOMETRY, LIVOX), most_sweeps_lost=0)


@pytest.mark.parametrize(("offset", "where"), in_turn(BAD_OFFSETS_NS))
def test_bad_offsets_of_livox_cost_themselves_alone(tmp_path: Path, offset: str, where: str) -> None:
    lines = messages(ODOMETRY, LIVOX)
    for k in MESSAGES[where]:
        for point in lines["/points"][1][k][2].points:
            point.offset_time = BAD_OFFSETS_NS[offset](point.offset_time)
    flight, _ = fly(tmp_path / "bad", lines)
    check_places(flight, undisturbed(ODOMETRY, LIVOX))
    assert len(placed(flight)) == sum(len(scan.stamp_ns) for scan in flight.scans)  # each at its own time


def test_a_topic_without_times_has_the_recorder_s_and_says_so(tmp_path: Path) -> None:
    lines = messages(ODOMETRY)
    kind, clouds = lines["/points"]
    lines["/points"] = kind, [(at_ns, 0, message) for at_ns, _, message in clouds]
    flight, feed = fly(tmp_path / "bag", lines)
    told = feed.summary()
    assert (told["stamped_by_recorder"], told["messages_without_stamp"]) == (["/points"], 0)
    assert min(placed(flight)) == BEGIN_NS + LATE_NS
