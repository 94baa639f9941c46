"""Accepted landing targets: their beginning, duration and position."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.guidance.precland import PrecisionLanding
from sitl.autopilot.parameters import DEFAULTS
from sitl.vehicle.rigid_body import State, from_euler
from tests.unit.sitl.bench_flight import Bench

F64 = NDArray[np.float64]
MS = 1_000_000
AT_ONCE = DEFAULTS | {"PLND_LAG": 0.0}
POSITION = (100.0, 50.0, 10.0)


def state(position: tuple[float, float, float] = POSITION, heading_rad: float = 0.0) -> State:
    return State(np.array(position), np.zeros(3), from_euler(0.0, 0.0, heading_rad), np.zeros(3), np.zeros(3))


def seen(
    stamp_us: int,
    body: tuple[float, float, float] = (2.0, 1.0, 10.0),
    *,
    frame: int = mavlink.MAV_FRAME_BODY_FRD,
    valid: int = 1,
    distance: float | None = None,
) -> mavlink.MAVLink_landing_target_message:
    away = float(np.linalg.norm(body)) if distance is None else distance
    return mavlink.MAVLink_landing_target_message(
        stamp_us, 0, frame, 0, 0, away, 0, 0, *body, [1, 0, 0, 0], 2, valid
    )


def stream(
    landing: PrecisionLanding,
    start_ms: int,
    end_ms: int,
    every_ms: int,
    pose: Callable[[], State] = state,
) -> int:
    """Feed targets from start to end inclusive; return the time of the last (ns)."""
    last = start_ms
    for now in range(start_ms, end_ms + 1, every_ms):
        landing.remember(now * MS, pose())
        landing.receive(seen(now * 1000), now * MS, AT_ONCE)
        last = now
    return last * MS


@pytest.mark.parametrize("every_ms", [50, 333, 450])
def test_a_target_is_believed_after_two_seconds_of_updates(every_ms: int) -> None:
    landing = PrecisionLanding()
    now = stream(landing, 1000, 2950, every_ms)
    assert landing.target(now) is None
    now = stream(landing, now // MS + every_ms, 3500, every_ms)
    assert landing.target(now) is not None


def test_a_gap_of_more_than_half_a_second_starts_the_two_seconds_again() -> None:
    landing = PrecisionLanding()
    stream(landing, 0, 1500, 100)
    now = stream(landing, 2100, 4000, 100)
    assert landing.target(now) is None
    now = stream(landing, 4100, 4100, 100)
    assert landing.target(now) is not None


def test_a_target_at_one_and_a_half_hertz_is_never_believed() -> None:
    landing = PrecisionLanding()
    assert landing.target(stream(landing, 0, 60_000, 667)) is None


def test_a_believed_target_is_predicted_for_two_seconds_and_then_lost() -> None:
    landing = PrecisionLanding()
    last = stream(landing, 0, 3000, 50)
    assert landing.target(last + 2000 * MS) is not None
    assert landing.target(last + 2001 * MS) is None


def test_a_lost_target_must_be_earned_again() -> None:
    landing = PrecisionLanding()
    stream(landing, 0, 3000, 50)
    assert landing.target(stream(landing, 6000, 7900, 50)) is None
    assert landing.target(stream(landing, 7950, 8050, 50)) is not None


@pytest.mark.parametrize(
    ("heading_rad", "expected"),
    [
        (0.0, (101.0, 52.0, 0.0)),  # facing north: 2 m ahead is north, 1 m right is east
        (np.pi / 2, (102.0, 49.0, 0.0)),  # facing east: ahead is east, right is south
        (np.pi, (99.0, 48.0, 0.0)),
    ],
)
def test_the_body_vector_is_placed_by_position_and_attitude(
    heading_rad: float, expected: tuple[float, float, float]
) -> None:
    landing = PrecisionLanding()
    now = stream(landing, 0, 3000, 50, lambda: state(heading_rad=heading_rad))
    target = landing.target(now)
    assert target is not None
    np.testing.assert_allclose(target, np.array(expected), atol=1e-9)


def test_a_measurement_is_placed_with_the_pose_of_its_own_time() -> None:
    landing = PrecisionLanding()
    for now_ms in range(0, 300, 10):
        landing.remember(now_ms * MS, state((now_ms / 10, 0.0, 10.0)))
    landing.receive(seen(1, (0.0, 0.0, 10.0)), 290 * MS, DEFAULTS | {"PLND_LAG": 0.1})
    assert landing.latest_enu_m is not None
    assert landing.latest_enu_m[0] == pytest.approx(19.0)


@pytest.mark.parametrize(
    "message",
    [
        seen(5, valid=0),
        seen(5, distance=0.0),
        seen(5, distance=-1.0),
        seen(5, (float("nan"), 0.0, 10.0), distance=10.0),
        seen(5, (0.0, float("inf"), 10.0), distance=10.0),
        seen(5, (0.2, 0.0, -0.1), distance=0.2),  # not below: AC_PrecLand, target_vec_valid
    ],
)
def test_targets_without_a_usable_position_are_dropped_silently(
    message: mavlink.MAVLink_landing_target_message,
) -> None:
    landing = PrecisionLanding()
    landing.remember(0, state())
    assert landing.receive(message, 0, AT_ONCE) is None
    assert landing.latest_enu_m is None


def test_other_frames_are_refused_with_one_text_and_never_used() -> None:
    landing = PrecisionLanding()
    landing.remember(0, state())
    texts = [
        landing.receive(seen(stamp, frame=mavlink.MAV_FRAME_LOCAL_NED), stamp * MS, AT_ONCE)
        for stamp in range(1, 50)
    ]
    assert texts[0] is not None
    assert texts[1:] == [None] * 48
    assert landing.latest_enu_m is None


def test_a_repeated_stamp_is_not_a_new_measurement() -> None:
    landing = PrecisionLanding()
    for now_ms in range(0, 5000, 50):
        landing.remember(now_ms * MS, state())
        landing.receive(seen(77), now_ms * MS, AT_ONCE)
    assert landing.target(5000 * MS) is None


def test_local_frd_is_taken_and_leads_elsewhere() -> None:
    landing = PrecisionLanding()
    landing.remember(0, state(heading_rad=np.pi / 2))
    landing.receive(seen(1), 0, AT_ONCE)
    right = landing.latest_enu_m
    assert right is not None
    np.testing.assert_allclose(right, [102.0, 49.0, 0.0], atol=1e-9)
    landing = PrecisionLanding()
    landing.remember(0, state(heading_rad=np.pi / 2))
    assert landing.receive(seen(1, frame=mavlink.MAV_FRAME_LOCAL_FRD), 0, AT_ONCE) is None
    wrong = landing.latest_enu_m
    assert wrong is not None
    np.testing.assert_allclose(wrong, [101.0, 52.0, 0.0], atol=1e-9)


def told(
    landing: PrecisionLanding, start_ms: int, end_ms: int, every_ms: int | None
) -> list[tuple[int, str]]:
    """Return the texts of a stretch of time, ten looks a second, with targets at an interval or none."""
    out = []
    for now in range(start_ms, end_ms, 10):
        landing.remember(now * MS, state())
        if every_ms is not None and (now - start_ms) % every_ms == 0:
            landing.receive(seen(now * 1000), now * MS, AT_ONCE)
        if now % 100 == 0:
            out += landing.status_texts(now * MS)
    return out


FOUND, COMPLETE = (6, "PrecLand: Target Found"), (6, "PrecLand: Init Complete")
LOST, FAILED = (2, "PrecLand: Target Lost"), (2, "PrecLand: Init Failed")


def test_the_target_is_announced_and_its_loss_is_critical() -> None:
    landing = PrecisionLanding()
    assert told(landing, 0, 1000, 50) == [FOUND]
    assert told(landing, 1000, 4000, 50) == [COMPLETE]
    assert told(landing, 4000, 5900, None) == []
    assert told(landing, 5900, 9000, None) == [LOST]
    assert told(landing, 9000, 12000, 50) == [FOUND, COMPLETE]


def test_a_target_that_comes_too_seldom_is_found_and_fails_again_and_again() -> None:
    assert told(PrecisionLanding(), 0, 2050, 700) == [FOUND, FAILED] * 3


def test_without_a_target_nothing_is_said() -> None:
    assert told(PrecisionLanding(), 0, 3000, None) == []


def test_the_autopilot_says_so_also_when_the_stream_ends_before_it_disarms() -> None:
    bench = Bench().airborne(5)
    bench.run(3, lambda: bench.landing_target(0, 0))
    assert bench.command(mavlink.MAV_CMD_NAV_LAND) == 0
    bench.run(2, lambda: bench.landing_target(0, 0))
    said = [(m.severity, m.text) for m in bench.sent if m.get_type() == "STATUSTEXT"]
    assert said[-2:] == [FOUND, COMPLETE]
    bench.run(3)
    said = [(m.severity, m.text) for m in bench.sent if m.get_type() == "STATUSTEXT"]
    assert said[-1] == LOST
    assert bench.autopilot.armed


@pytest.mark.parametrize(
    ("parameters", "east_m", "north_m"),
    [
        ({}, 3.0, 0.0),
        ({"PLND_LAND_OFS_X": 70.0}, 3.0, 0.7),  # forward is north here
        ({"PLND_LAND_OFS_Y": -50.0}, 2.5, 0.0),
        ({"PLND_YAW_ALIGN": 9000.0}, 0.0, -3.0),
        ({"PLND_CAM_POS_X": 0.5, "PLND_CAM_POS_Y": 0.5}, 3.0, 0.0),  # added and taken off again
    ],
)
def test_a_target_is_turned_and_shifted_by_what_was_meant_for_a_camera(
    parameters: dict[str, float], east_m: float, north_m: float
) -> None:
    landing, now_ns = PrecisionLanding(), 0
    for tick in range(50):
        now_ns = tick * 50 * MS
        landing.remember(now_ns, state())
        landing.receive(seen(tick + 1, (0.0, 3.0, 10.0)), now_ns, AT_ONCE | parameters)
    target = landing.target(now_ns)
    assert target is not None
    assert np.allclose(target[:2] - POSITION[:2], (east_m, north_m), atol=1e-6)
