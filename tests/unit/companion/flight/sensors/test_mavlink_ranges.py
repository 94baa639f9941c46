"""Ranges of the autopilot's own sensors as returns."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from companion.flight.geometry.sensor_mount import Mount
from companion.flight.link.clock.autopilot_clock import AutopilotClock
from companion.flight.sensors.mavlink_ranges import MavlinkRanges
from companion.flight.sensors.returns import Returns
from params import Parameters

NOW = 5_000_000_000


class Bench:
    def __init__(self) -> None:
        self.batches: list[Returns] = []
        self.parameters = Parameters()
        self.clock = AutopilotClock()
        self.clock.stamp_ns(1000, NOW)  # of a pose
        self.ranges = MavlinkRanges(self.parameters, self.clock, self.batches.append)

    def body(self) -> np.ndarray:
        """Return what came, placed on the vehicle by the mount."""
        mount = Mount(self.parameters)
        points = np.concatenate([batch.xyz_sensor_m for batch in self.batches])
        return points @ mount.rotation_frd_from_sensor.T + mount.lever_frd_m


def beam(
    cm: int, orientation: int, low: int = 20, high: int = 5000
) -> mavlink.MAVLink_distance_sensor_message:
    return mavlink.MAVLink_distance_sensor_message(1000, low, high, cm, 0, 1, orientation, 0)


def ring(distances: list[int], **fields: object) -> mavlink.MAVLink_obstacle_distance_message:
    values = {"increment": 5, "increment_f": 0.0, "angle_offset": 0.0, "frame": 12} | fields
    return mavlink.MAVLink_obstacle_distance_message(
        1_000_000, 0, distances + [65535] * (72 - len(distances)), values["increment"], 20, 5000,
        values["increment_f"], values["angle_offset"], values["frame"],
    )  # fmt: skip


def attitude(
    yaw_deg: float, pitch_deg: float, roll_deg: float, boot_ms: int = 1000
) -> mavlink.MAVLink_attitude_quaternion_message:
    turned = Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True)
    x, y, z, w = turned.as_quat()
    return mavlink.MAVLink_attitude_quaternion_message(boot_ms, w, x, y, z, 0, 0, 0)


@pytest.mark.parametrize(
    ("orientation", "frd"),
    [(25, (0, 0, 8)), (24, (0, 0, -8)), (0, (8, 0, 0)), (2, (0, 8, 0)), (6, (0, -8, 0))],
)
def test_a_range_lies_where_its_sensor_looks(orientation: int, frd: tuple[float, float, float]) -> None:
    bench = Bench()
    bench.ranges.on_message(beam(800, orientation), NOW)
    np.testing.assert_allclose(bench.body(), [frd], atol=1e-5)
    assert bench.batches[0].stamp_ns.tolist() == [NOW]


@pytest.mark.parametrize("cm", [20, 5000, 0, 65535])
def test_a_range_at_its_limits_is_no_return(cm: int) -> None:
    bench = Bench()
    bench.ranges.on_message(beam(cm, 25), NOW)
    assert not bench.batches
    assert bench.ranges.counters.no_return == 1


@pytest.mark.parametrize(("quality", "seen"), [(0, True), (1, False), (2, True), (100, True)])
def test_a_range_whose_signal_is_invalid_is_no_return(quality: int, seen: bool) -> None:
    """Its sensor says so by a signal quality of 1; the range it tells with it lies within its limits."""
    bench = Bench()
    message = beam(800, 25)
    message.signal_quality = quality
    bench.ranges.on_message(message, NOW)
    assert bool(bench.batches) is seen
    assert bench.ranges.counters.no_return == (not seen)


@pytest.mark.parametrize(
    "message",
    [
        beam(800, 99),
        ring([500], frame=3),
        ring([500], increment=0),
        ring([500], increment_f=float("nan")),
        ring([500], angle_offset=float("nan")),
    ],
)
def test_directions_that_nobody_can_know_are_counted(message: object) -> None:
    bench = Bench()
    bench.ranges.on_message(message, NOW)
    assert not bench.batches
    assert bench.ranges.counters.malformed == 1


def test_sectors_lie_clockwise_from_the_offset() -> None:
    bench = Bench()
    bench.ranges.on_message(ring([65535, 1000, 1000], increment_f=45.0, angle_offset=45.0), NOW)
    np.testing.assert_allclose(bench.body(), [[0, 10, 0], [-7.0711, 7.0711, 0]], atol=1e-3)


BODY, LOCAL, GLOBAL, NED = 12, 20, 0, 1
C, S = 10 * np.cos(np.radians(25)), 10 * np.sin(np.radians(25))


@pytest.mark.parametrize(
    ("frame", "vehicle", "frd"),
    [
        (BODY, (90, 0, 25), (0, 10, 0)),
        (LOCAL, (0, 0, 25), (0, C, -S)),  # level and to the right of a vehicle whose right side is low
        (LOCAL, (130, 0, 25), (0, C, -S)),
        (LOCAL, (130, 25, 0), (0, 10, 0)),
        (GLOBAL, (0, 0, 0), (0, 10, 0)),  # in the east
        (GLOBAL, (90, 0, 0), (10, 0, 0)),
        (NED, (180, 0, 25), (0, -C, S)),
        (GLOBAL, (90, 25, 0), (C, 0, S)),  # nose up
    ],
)
def test_a_sector_lies_where_its_frame_says(
    frame: int, vehicle: tuple[float, float, float], frd: tuple[float, float, float]
) -> None:
    bench = Bench()
    for boot_ms, angles in ((900, (45, 30, 30)), (1010, vehicle), (1100, (45, 30, 30))):
        bench.ranges.on_message(attitude(*angles, boot_ms), NOW)
    bench.ranges.on_message(ring([1000], angle_offset=90.0, frame=frame), NOW)
    np.testing.assert_allclose(bench.body(), [frd], atol=1e-4)


@pytest.mark.parametrize("frame", [LOCAL, GLOBAL, NED])
def test_level_sectors_without_an_attitude_of_their_time_are_counted_and_not_placed(frame: int) -> None:
    bench = Bench()
    bench.ranges.on_message(attitude(0, 0, 0, 900), NOW)
    bench.ranges.on_message(ring([1000], frame=frame), NOW)
    assert not bench.batches
    assert (bench.ranges.counters.without_attitude, bench.ranges.counters.malformed) == (1, 0)


def test_other_messages_are_passed_over() -> None:
    bench = Bench()
    bench.ranges.on_message(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3), NOW)
    assert bench.ranges.counters.packets == 0


def test_nothing_seen_around_is_no_return() -> None:
    bench = Bench()
    bench.ranges.on_message(ring([65535] * 72), NOW)
    assert not bench.batches
    assert (bench.ranges.counters.no_return, bench.ranges.counters.malformed) == (1, 0)


def test_a_range_whose_stamp_cannot_be_is_counted_and_not_placed() -> None:
    bench = Bench()
    bench.ranges.on_message(beam(800, 25), NOW)
    bench.ranges.on_message(beam(700, 25), NOW + 60_000_000_000)  # the same stamp a minute later
    assert len(bench.batches) == 1
    assert bench.ranges.statistics()["without_time"] == 1
    assert bench.ranges.last_arrival_ns == NOW


def test_a_range_before_any_pose_is_not_placed() -> None:
    batches: list[Returns] = []
    ranges = MavlinkRanges(Parameters(), AutopilotClock(), batches.append)
    ranges.on_message(beam(800, 25), NOW)
    assert not batches
    assert ranges.counters.without_time == 1


def test_ranges_stamped_by_another_clock_do_not_touch_the_autopilots() -> None:
    bench = Bench()
    unix = ring([1000])
    unix.time_usec = 1_790_000_000_000_000
    for number in range(25):
        bench.ranges.on_message(unix, NOW + number * 100_000_000)
    assert not bench.batches
    assert bench.ranges.counters.without_time == 25
    assert (bench.clock.source, bench.clock.implausible) == ("arrival", 0)
    bench.ranges.on_message(beam(800, 25), NOW + 5_000_000)
    assert bench.batches[0].stamp_ns.tolist() == [NOW]
