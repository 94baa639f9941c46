"""Bags in which a clock is set in flight, as GNSS or NTP sets that of a computer or of a LiDAR."""

from __future__ import annotations

from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from companion.desk.replay.ros.topic_clocks import false_stamps
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME
from tests.unit.companion.desk.replay.ros.test_bad_stamps import (
    AFTER_NS,
    FIX,
    ODOMETRY,
    Flight,
    fly,
    messages,
)

Lines = dict[str, tuple[str, list[tuple[int, int, Any]]]]
Late = list[int | None]
SWEEPS, MS = 60, 1_000_000
SET_NS = BEGIN_NS + 3_020 * MS
BAG = Path("flight.mcap")
STEPS_MS = {
    "37 s on": 37_000,
    "2.5 s back": -2_500,
    "an hour on": 3_600_000,
    "an hour back": -3_600_000,
    "0.3 s on": 300,
    "0.3 s back": -300,
    "from 1970": BEGIN_NS // MS - 60_000,
}
CLOUDS, POSES = {"/points"}, {"/pose", "/fix", "/imu"}
TOPICS = {"all": CLOUDS | POSES, "clouds": CLOUDS, "poses": POSES, "none": set[str]()}


def numbered(poses: str) -> Lines:
    """Return a flight whose points are numbered by their intensity, since stamps change."""
    lines = messages(poses, sweeps=SWEEPS)
    for k, (_, _, message) in enumerate(lines["/points"][1]):
        table = message.data.copy().view([("xyz", "<f4", 3), ("i", "<f4"), ("t", "<u4")])
        table["i"] = k * len(AFTER_NS) + np.arange(len(AFTER_NS))
        message.data = table.view(np.uint8)
    return lines


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


def check_places(flight: Flight, poses: str, least: float, most_astray: int = 0) -> None:
    """See that so great a share is placed, and but for so many points within 3 cm of where they belong."""
    found, wanted = placed(flight), undisturbed(poses)
    assert len(found) >= least * len(wanted)
    assert sum(float(np.linalg.norm(found[k] - wanted[k])) > 0.03 for k in found) <= most_astray


SET = [(of, recorder) for of in TOPICS for recorder in (False, True) if recorder or TOPICS[of]]


@pytest.mark.parametrize(
    ("step", "of", "recorder", "poses"),
    [(step, *which, (ODOMETRY, FIX)[k % 2]) for k, (step, which) in enumerate(product(STEPS_MS, SET))],
)
def test_a_clock_that_is_set_misplaces_nothing(
    tmp_path: Path, of: str, step: str, poses: str, recorder: bool
) -> None:
    """Stamps of some topics step, and the recorder's clock or not: points are where they were, or refused."""
    lines, step_ns = numbered(poses), STEPS_MS[step] * MS
    early_ns = step_ns if step == "from 1970" else 0  # the clock of the end is right

    def told(at_ns: int, steps: bool) -> int:
        return at_ns + (step_ns * (at_ns >= SET_NS) - early_ns) * steps

    for topic, (kind, rows) in lines.items():
        steps = topic in TOPICS[of]
        lines[topic] = kind, [(told(at, recorder), told(stamp, steps), one) for at, stamp, one in rows]
    alike = of in ("all", "none")
    try:
        flight, _ = fly(tmp_path / "bag", lines)
    except UsageError as error:
        said, refused = str(error), True
    else:
        said, refused = "", False
    if refused:
        assert said.endswith(": a clock was set in flight; cut the bag there")
        assert not alike or step_ns < 0
        return
    # All clocks together by less than a second: points of about that time are among poses of another.
    astray = 200 if of == "all" and abs(step_ns) < 1000 * MS else 0
    check_places(flight, poses, 0.9 if alike and step_ns > 0 else 0.05, astray)


SINGLE = product(("/points", "/pose"), (0, 29, SWEEPS - 1))


@pytest.mark.parametrize(
    ("topic", "where", "ahead_ms"), [(*one, (-2500, 2500)[k % 2]) for k, one in enumerate(SINGLE)]
)
def test_a_single_stamp_of_another_time_costs_itself(
    tmp_path: Path, topic: str, where: int, ahead_ms: int
) -> None:
    lines = numbered(ODOMETRY)
    rows = lines[topic][1]
    k = where * (len(rows) - 1) // (SWEEPS - 1)
    rows[k] = rows[k][0], rows[k][1] + ahead_ms * MS, rows[k][2]
    flight, feed = fly(tmp_path / "bag", lines)
    check_places(flight, ODOMETRY, least=0.95)
    assert feed.summary()["messages_with_false_stamp"] <= 1


def clouds_late(late_ms: Late, period_ms: int = 100) -> dict[str, set[tuple[int, int]]]:
    """Return what is refused beside poses without delays of clouds recorded so late, or lost."""
    poses = [(BEGIN_NS + 40 * k * MS,) * 2 for k in range(5 * len(late_ms))]
    stamps = [BEGIN_NS + k * period_ms * MS for k in range(len(late_ms))]
    clouds = [(at + late * MS, at) for at, late in zip(stamps, late_ms, strict=True) if late is not None]
    return false_stamps(BAG, {"/points": clouds, "/pose": poses})


def test_clouds_that_wait_in_a_queue_are_of_no_other_clock() -> None:
    """A stall of three seconds, after which all come at once; a queue that is emptied; uneven delays."""
    stall: Late = [*[115] * 60, *(3115 - 100 * k for k in range(31)), *[115] * 60]
    emptied: Late = [*[815] * 60, *(815 - 100 * k for k in range(7)), *[115] * 60]
    uneven: Late = [*np.random.default_rng(1).integers(50, 450, 200).tolist()]
    for late in (stall, stall[:60] + stall[80:], emptied, uneven):
        for period_ms in (100, 200):
            assert not any(clouds_late(late, period_ms).values())


def test_processed_poses_that_come_when_they_are_ready_are_of_one_clock() -> None:
    """Odometry of every first to fourth sweep, 0.05 to 0.45 s after it."""
    rng = np.random.default_rng(2)
    stamps = BEGIN_NS + 100 * MS * np.cumsum(rng.integers(1, 5, 300))
    ready = np.maximum.accumulate(stamps + MS * rng.integers(50, 450, 300))
    poses = list(zip(ready.tolist(), stamps.tolist(), strict=True))
    clouds = [(BEGIN_NS + (100 * k + 115) * MS, BEGIN_NS + 100 * k * MS) for k in range(700)]
    assert not any(false_stamps(BAG, {"/points": clouds, "/pose": poses}).values())


def test_a_recorder_that_stalls_and_sensors_that_share_a_topic_are_of_one_clock() -> None:
    """At 100 Hz a second's burst is longer than any count of messages; clouds overtake each other."""
    poses = [(BEGIN_NS + (10 * k + 10) * MS, BEGIN_NS + 10 * k * MS) for k in range(6000)]
    clouds = [(BEGIN_NS + (100 * k + 115) * MS, BEGIN_NS + 100 * k * MS) for k in range(600)]
    late = [(at + 110 * MS, stamp + 50 * MS) for at, stamp in clouds]
    begin, end = BEGIN_NS + 20_000 * MS, BEGIN_NS + 21_000 * MS
    stalled = [(end + k if begin <= at < end else at, stamp) for k, (at, stamp) in enumerate(poses)]
    topics = {"/points": sorted(clouds + late), "/pose": stalled}
    assert not any(false_stamps(BAG, topics).values())


@pytest.mark.parametrize("lost", [0, 1, 10, 40])
def test_a_clock_set_while_messages_are_lost_is_found(lost: int) -> None:
    with pytest.raises(UsageError, match=r"stamps on /points step by -0\.7 s, and those on /pose do not"):
        clouds_late([115] * 60 + [None] * lost + [815] * 60)
