"""Bags whose stamps or times of recording step in flight, as GNSS or NTP sets the clock of a computer."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from companion.desk.replay.ros.bag_file import BagFile
from companion.desk.replay.ros.ros_feed import RosFeed
from companion.desk.replay.ros.topic_clocks import TopicClocks
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME
from tests.unit.companion.desk.replay.ros.test_bad_stamps import (
    AFTER_NS,
    BAD,
    FIX,
    ODOMETRY,
    Flight,
    S,
    fly,
    messages,
)

SWEEPS = 60
MS = 1_000_000
SET_NS = BEGIN_NS + 3_020 * MS
STEPS_NS = {
    "37 s on": 37 * S,
    "2.5 s back": -2500 * MS,
    "an hour on": 3600 * S,
    "an hour back": -3600 * S,
    "0.3 s on": 300 * MS,
    "0.3 s back": -300 * MS,
    "from 1970": BEGIN_NS - 60 * S,
}
CLOUDS, POSES = {"/points"}, {"/pose", "/fix", "/imu"}
TOPICS = {"all": CLOUDS | POSES, "clouds": CLOUDS, "poses": POSES, "none": set[str]()}
UNTOLD, MIXED = "cannot be told when they agreed", "set back by .* before and after have the same times"

Lines = dict[str, tuple[str, list[tuple[int, int, Any]]]]


def numbered(poses: str) -> Lines:
    """Return a flight whose points are numbered by their intensity."""
    lines = messages(poses, sweeps=SWEEPS)
    for k, (_, _, message) in enumerate(lines["/points"][1]):
        table = message.data.copy().view([("xyz", "<f4", 3), ("i", "<f4"), ("t", "<u4")])
        table["i"] = k * len(AFTER_NS) + np.arange(len(AFTER_NS))
        message.data = table.view(np.uint8)
    return lines


def stepped(lines: Lines, step: str, of: str, recorder: bool) -> Lines:
    """Return a flight in which stamps of some topics, and the recorder's clock or not, step."""
    step_ns = STEPS_NS[step]
    early_ns = step_ns if step == "from 1970" else 0  # the clock of the end is right

    def told(at_ns: int, steps: bool) -> int:
        return at_ns + (step_ns * (at_ns >= SET_NS) - early_ns) * steps

    return {
        topic: (
            kind,
            [
                (told(at_ns, recorder), told(stamp_ns, topic in TOPICS[of]), one)
                for at_ns, stamp_ns, one in all_of
            ],
        )
        for topic, (kind, all_of) in lines.items()
    }


def placed(flight: Flight) -> dict[int, np.ndarray]:
    """Return the points on the Earth by their numbers."""
    numbers = {
        stamp_ns: round(number)
        for batch in flight.batches
        for stamp_ns, number in zip(batch.stamp_ns.tolist(), batch.intensity.tolist(), strict=True)
    }
    return {
        numbers[stamp_ns]: place
        for scan in flight.scans
        for stamp_ns, place in zip(
            scan.stamp_ns.tolist(), HOME.enu_m(*scan.frame.lla(scan.points_enu_m).T), strict=True
        )
    }


@cache
def undisturbed(poses: str) -> dict[int, np.ndarray]:
    with TemporaryDirectory() as folder:
        return placed(fly(Path(folder) / "good", numbered(poses))[0])


def check(
    path: Path, lines: Lines, poses: str = ODOMETRY, least: float = 1.0, within_m: float = 0.005
) -> RosFeed:
    """See that so great a share of the points is placed, and where they belong; return the feed."""
    flight, feed = fly(path, lines)
    found, wanted = placed(flight), undisturbed(poses)
    assert len(found) >= least * len(wanted)
    assert max(float(np.linalg.norm(found[k] - wanted[k])) for k in found) < within_m
    return feed


@pytest.mark.parametrize("step", STEPS_NS)
@pytest.mark.parametrize("of", TOPICS)
def test_stamps_that_step_cost_nothing_or_the_bag_is_refused(tmp_path: Path, of: str, step: str) -> None:
    """The recorder has a clock of its own, that goes on."""
    lines = stepped(numbered(ODOMETRY), step, of, recorder=False)
    if (of, step) in {("clouds", "0.3 s on"), ("poses", "0.3 s back")}:  # clouds 0.1 s late, then 0.2 s early
        with pytest.raises(UsageError, match=UNTOLD):
            fly(tmp_path / "bag", lines)
        return
    told = check(tmp_path / "bag", lines).summary()["clock_steps"]
    of_all = sorted(TOPICS[of] & set(lines))
    assert sorted(one["topic"] for one in told) == of_all
    assert [one["step_ns"] for one in told] == [STEPS_NS[step]] * len(of_all)


@pytest.mark.parametrize("step", STEPS_NS)
@pytest.mark.parametrize("of", TOPICS)
def test_a_recorder_whose_clock_steps_misplaces_nothing(tmp_path: Path, of: str, step: str) -> None:
    lines = stepped(numbered(ODOMETRY), step, of, recorder=True)
    mixed = of != "none" and step in ("2.5 s back", "0.3 s back")
    if mixed or (of, step) == ("clouds", "0.3 s on"):
        with pytest.raises(UsageError, match=MIXED if mixed else UNTOLD):
            fly(tmp_path / "bag", lines)
    elif (of, step) == ("all", "0.3 s on"):  # looks like a pause: a sweep across it is smeared
        check(tmp_path / "bag", lines, within_m=0.4)
    elif (of, step) == ("none", "2.5 s back"):  # poses out of order are refused
        check(tmp_path / "bag", lines, least=0.5, within_m=0.03)
    else:
        check(tmp_path / "bag", lines, least=0.95, within_m=0.03)


@pytest.mark.parametrize("step", ["37 s on", "2.5 s back", "0.3 s back", "from 1970"])
def test_fixes_and_orientations_step_with_the_clouds(tmp_path: Path, step: str) -> None:
    check(tmp_path / "bag", stepped(numbered(FIX), step, "all", recorder=False), FIX)


@pytest.mark.parametrize("stamp", BAD)
def test_bad_stamps_beside_a_step_cost_themselves_alone(tmp_path: Path, stamp: str) -> None:
    lines = stepped(numbered(ODOMETRY), "37 s on", "all", recorder=False)
    for topic, first in (("/points", 40), ("/pose", 60)):
        entries = lines[topic][1]
        for k in (0, 1, *range(first, first + 3)):
            entries[k] = entries[k][0], BAD[stamp](entries[k][1]), entries[k][2]
    check(tmp_path / "bag", lines, least=0.85, within_m=0.02)


def clouds_late(late_ms: list[int | None], period_ms: int = 100) -> TopicClocks:
    """Return the clocks of poses without delays, and of clouds recorded so late or lost."""
    times = [("/pose", BEGIN_NS + 40 * k * MS, BEGIN_NS + 40 * k * MS) for k in range(5 * len(late_ms))]
    for k, late in enumerate(late_ms):
        stamp_ns = BEGIN_NS + k * period_ms * MS
        times += [("/points", stamp_ns + late * MS, stamp_ns)] if late is not None else []
    return TopicClocks(times, ["/pose"])


def test_clouds_that_wait_in_a_queue_are_of_no_other_clock() -> None:
    """A stall of three seconds, after which all come at once; a queue that stays full, is emptied or lost."""
    stall: list[int | None] = [115] * 60 + [3115 - 100 * k for k in range(31)] + [115] * 60
    assert clouds_late(stall).steps == []
    assert clouds_late([115] * 60 + [815] * 60).steps == []
    assert clouds_late(stall[:60] + stall[80:], period_ms=200).steps == []
    emptied: list[int | None] = [815] * 60 + [815 - 100 * k for k in range(7)] + [115] * 60
    assert clouds_late(emptied, period_ms=101).steps == []
    assert clouds_late(emptied, period_ms=200).steps == []
    assert clouds_late([815] * 60 + [None] * 7 + [115] * 60).steps == []


@pytest.mark.parametrize("form", ["sqlite", "mcap", "ros1"])
def test_times_of_a_bag_are_in_the_order_of_storage(tmp_path: Path, form: str) -> None:
    told = [(BEGIN_NS + ms * MS, BEGIN_NS + 5 * ms * MS) for ms in (0, 100, 50, 200)]
    plugin = StoragePlugin.MCAP if form == "mcap" else StoragePlugin.SQLITE3
    path = tmp_path / ("flight.bag" if form == "ros1" else "bag")
    types = get_typestore(Stores.ROS1_NOETIC) if form == "ros1" else flights.STORE
    writer: Any = Writer1(path) if form == "ros1" else Writer(path, version=9, storage_plugin=plugin)
    with writer:
        line = writer.add_connection("/pose", ODOMETRY, typestore=types)
        for at_ns, stamp_ns in told:
            message = flights.pose(ODOMETRY, (stamp_ns - BEGIN_NS) // MS)
            if form == "ros1":
                header = message.header
                message.header = types.types["std_msgs/msg/Header"](0, header.stamp, header.frame_id)
            pack = types.serialize_ros1 if form == "ros1" else types.serialize_cdr
            writer.write(line, at_ns, pack(message, ODOMETRY))
    bag = BagFile(path)
    assert list(bag.times(("/pose",))) == [("/pose", *both) for both in told]
    assert [at_ns for at_ns, *_ in bag.messages(("/pose",))] == sorted(at_ns for at_ns, _ in told)
