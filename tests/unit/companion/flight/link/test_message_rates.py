"""Requests of streams: once, repeated when absent, with decreasing frequency."""

from __future__ import annotations

import pytest

from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.autopilots.autopilot_interface import Autopilot
from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.message_rates import StreamKeeper, expected, wanted

MS, S = 1_000_000, 1_000_000_000


def asked_until(
    keeper: StreamKeeper, begin_ns: int, end_ns: int, heard: dict[str, int] | None = None
) -> list[str]:
    """Accept every request at once, deliver `heard` streams at their intervals, return what was asked for."""
    names = []
    for now in range(begin_ns, end_ns, 10 * MS):
        for name, interval_ns in heard.items():
            if now % interval_ns == 0:
                keeper.record_arrival(name, now)
        while stream := keeper.due(now):
            names.append(stream.name)
            keeper.record_request(stream, now, accepted=True)
    return names


ALL = {stream.name: round(1e9 / stream.rate_hz) for stream in wanted(ARDUPILOT, 50.0)}


def keeper() -> StreamKeeper:
    made = StreamKeeper()
    made.want(wanted(ARDUPILOT, 50.0))
    return made


def test_everything_is_asked_for_once_the_pose_first_and_then_it_flows() -> None:
    names = asked_until(keeper(), 0, 30 * S, ALL)
    assert names[:2] == ["ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT"]
    assert sorted(names) == sorted(ALL)


def test_a_stream_that_stays_away_is_asked_for_again_ever_more_seldom() -> None:
    heard = {name: ns for name, ns in ALL.items() if name != "BATTERY_STATUS"}
    kept = keeper()
    names = asked_until(kept, 0, 120 * S, heard)
    assert 4 <= names.count("BATTERY_STATUS") <= 8
    assert kept.missing(120 * S) == ("BATTERY_STATUS",)
    assert len(names) == len(ALL) - 1 + names.count("BATTERY_STATUS")


def test_a_stream_that_ends_is_asked_for_within_three_seconds() -> None:
    kept = keeper()
    asked_until(kept, 0, 20 * S, ALL)
    rest = {name: ns for name, ns in ALL.items() if name != "ATTITUDE_QUATERNION"}
    assert asked_until(kept, 20 * S, 23 * S, rest) == ["ATTITUDE_QUATERNION"]


def test_a_stream_slowed_by_another_program_is_asked_for_again() -> None:
    kept = keeper()
    asked_until(kept, 0, 20 * S, ALL)
    slowed = ALL | {"GLOBAL_POSITION_INT": 250 * MS}
    assert "GLOBAL_POSITION_INT" in asked_until(kept, 20 * S, 30 * S, slowed)


def test_after_a_reboot_everything_is_asked_for_again() -> None:
    kept = keeper()
    asked_until(kept, 0, 20 * S, ALL)
    kept.reset()
    assert sorted(asked_until(kept, 20 * S, 21 * S, ALL)) == sorted(ALL)


def test_a_refused_stream_does_not_keep_the_others_waiting() -> None:
    kept = keeper()
    first = kept.due(0)
    assert first is not None
    kept.record_request(first, 0, accepted=False)
    second = kept.due(0)
    assert second is not None
    assert second.name != first.name


def test_px4_is_asked_for_its_local_frame_too() -> None:
    names = {stream.name for stream in wanted(PX4, 50.0)}
    assert "LOCAL_POSITION_NED" in names
    assert "GPS_GLOBAL_ORIGIN" not in names  # sent once and when it changes: no stream that could be missing


def test_px4_is_asked_for_its_mode_and_not_for_the_heartbeat_whose_rate_is_fixed() -> None:
    asked = {stream.name: stream for stream in wanted(PX4, 50.0)}
    assert "HEARTBEAT" not in asked
    assert (asked["CURRENT_MODE"].message_id, asked["CURRENT_MODE"].interval_us) == (436, 200_000)
    arriving = {stream.name: stream.arrives_hz for stream in expected(PX4, 50.0)}
    assert (arriving["HEARTBEAT"], arriving["CURRENT_MODE"]) == (1.0, 2.0)
    assert expected(ARDUPILOT, 50.0) == wanted(ARDUPILOT, 50.0)


def test_each_autopilot_is_asked_for_the_wind_that_it_may_estimate() -> None:
    for autopilot, name, number in ((ARDUPILOT, "WIND", 168), (PX4, "WIND_COV", 231)):
        stream = next(s for s in wanted(autopilot, 50.0) if "WIND" in s.name)
        assert (stream.name, stream.message_id, stream.rate_hz, stream.needed) == (name, number, 2.0, False)


def px4_keeper() -> StreamKeeper:
    made = StreamKeeper()
    made.want(wanted(PX4, 50.0))
    return made


PX4_NS = {stream.name: round(1e9 / stream.arrives_hz) for stream in wanted(PX4, 50.0)}


def test_a_mode_that_comes_twice_a_second_is_not_asked_for_again() -> None:
    kept = px4_keeper()
    assert asked_until(kept, 0, 60 * S, PX4_NS).count("CURRENT_MODE") == 1
    assert kept.missing(60 * S) == ()


@pytest.mark.parametrize("answered", [True, False])
def test_a_stream_that_is_not_needed_and_refused_is_not_asked_for_again_until_a_reboot(
    answered: bool,
) -> None:
    kept = px4_keeper()
    rest = {name: ns for name, ns in PX4_NS.items() if name != "CURRENT_MODE"}
    asked = 0
    for now in range(0, 60 * S, 10 * MS):
        for name, interval_ns in rest.items():
            if now % interval_ns == 0:
                kept.record_arrival(name, now)
        while stream := kept.due(now):
            refused = stream.name == "CURRENT_MODE"
            asked += refused
            kept.record_request(stream, now, accepted=not refused, answered=answered or not refused)
    assert (asked == 1) == answered  # no answer is no refusal
    assert kept.refused == (("CURRENT_MODE",) if answered else ())
    kept.reset()
    assert kept.refused == ()


def test_intervals_are_in_microseconds() -> None:
    assert [s.interval_us for s in wanted(ARDUPILOT, 50.0)][:3] == [20_000, 20_000, 200_000]


def test_the_local_position_is_asked_for_where_something_is_sent_in_its_frame() -> None:
    def asks(autopilot: Autopilot, odometry: bool) -> bool:
        streams = expected(autopilot, 50.0, odometry)
        return "LOCAL_POSITION_NED" in {stream.name for stream in streams}

    assert [asks(name, sent) for name in (ARDUPILOT, PX4) for sent in (False, True)] == [
        False, True, True, True,
    ]  # fmt: skip
