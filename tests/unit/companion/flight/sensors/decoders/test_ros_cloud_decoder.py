"""Clouds of a ROS driver: points with their times, and everything that is none."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.sensors.decoders.ros_cloud_decoder import INSTANT, JUDGED_CLOUDS, RosCloudDecoder
from companion.flight.sensors.returns import RawReturns
from companion.flight.sensors.sensor_registry import decoder_for
from tests.unit.companion.flight.sensors.decoders.clouds import BEGIN_NS, PERIOD_NS, STORE, Driver

DRIVER = Driver()
LAST = JUDGED_CLOUDS + 1


def decoded(decoder: RosCloudDecoder, packet: bytes) -> RawReturns | None:
    """Return the points of a packet, None if it is refused."""
    stamp_ns = decoder.check(packet)
    if stamp_ns is None:
        return None
    decoder.add_packet(packet)
    assert len(decoder) == 1
    found = decoder.drain()
    assert len(decoder) == 0
    assert not len(found) or stamp_ns == found.stamp_ns[-1]
    return found


def judged(driver: Driver = DRIVER, metadata: str = "") -> RosCloudDecoder:
    """Return a decoder that has seen the first ten clouds of a driver."""
    decoder = RosCloudDecoder(metadata)
    assert [decoded(decoder, driver.packet(k)) for k in range(1, LAST)] == [None] * JUDGED_CLOUDS
    return decoder


def test_each_point_has_its_own_time_once_ten_clouds_show_what_the_times_mean() -> None:
    decoder = judged()
    assert (decoder.counters.judged, decoder.counters.packets) == (10, 0)
    found = decoded(decoder, DRIVER.packet(LAST))
    assert found is not None
    np.testing.assert_array_equal(
        found.stamp_ns, BEGIN_NS + LAST * PERIOD_NS + np.arange(DRIVER.points) * 1_000_000
    )
    np.testing.assert_array_equal(found.xyz_m[7], np.array([20, 7, -1], np.float32))
    assert (found.intensity == 9).all()
    assert found.has_thin_rays
    counters = decoder.counters
    assert (counters.packets, counters.returns, counters.malformed) == (1, 100, 0)


def test_points_without_a_return_are_left_out_and_counted() -> None:
    xyz = np.tile(np.array([5, 0, 0], np.float32), (100, 1))
    xyz[3], xyz[4] = 0, np.nan
    decoder = judged(DRIVER.but(xyz=xyz))
    found = decoded(decoder, DRIVER.but(xyz=xyz).packet(LAST))
    assert found is not None
    assert (len(found), decoder.counters.no_return) == (98, 2)


def test_clouds_without_times_of_their_points_are_never_used(caplog: pytest.LogCaptureFixture) -> None:
    driver = DRIVER.but(time_field="")
    decoder = judged(driver)
    assert decoded(decoder, driver.packet(LAST)) is None
    assert (decoder.counters.untimed, decoder.counters.packets) == (10, 0)
    assert decoder.counters.judged == 1
    assert "the points have no times" in caplog.text
    assert caplog.text.count("is not used") == 1


def test_a_cloud_of_one_instant_needs_no_times_where_the_user_says_so() -> None:
    decoder = RosCloudDecoder(INSTANT)
    found = decoded(decoder, DRIVER.but(time_field="").packet(1))
    assert found is not None
    assert set(found.stamp_ns.tolist()) == {BEGIN_NS + PERIOD_NS}
    assert not found.has_thin_rays


def test_a_driver_that_changes_the_meaning_of_its_times_is_judged_anew() -> None:
    decoder = judged()
    other = DRIVER.but(time_field="offset_time")
    refused = [decoded(decoder, other.packet(k)) for k in range(LAST, LAST + JUDGED_CLOUDS)]
    assert refused == [None] * JUDGED_CLOUDS
    assert decoder.counters.untimed == JUDGED_CLOUDS
    assert decoded(decoder, other.packet(2 * LAST)) is not None


@pytest.mark.parametrize("frame", ["map", "odom", "/map", "world"])
def test_points_in_the_map_s_axes_are_refused(frame: str, caplog: pytest.LogCaptureFixture) -> None:
    decoder = RosCloudDecoder(INSTANT)
    assert decoded(decoder, DRIVER.but(frame=frame).packet(1)) is None
    assert (decoder.counters.placed, decoder.counters.malformed) == (1, 0)
    assert "not in the sensor's axes" in caplog.text


def test_lost_clouds_are_counted_by_the_publisher_s_numbers() -> None:
    decoder = judged()
    for number in (LAST, LAST + 1, LAST + 4, 2):
        assert decoded(decoder, DRIVER.packet(number)) is not None
    assert decoder.counters.lost_packets == 2
    assert decoded(decoder, DRIVER.but(gid=b"another driver 2").packet(LAST + 9)) is not None
    assert decoder.counters.lost_packets == 2


def test_any_other_bytes_are_counted_and_never_raise(caplog: pytest.LogCaptureFixture) -> None:
    whole = DRIVER.but(points=5).packet(LAST)
    decoder = judged(DRIVER.but(points=5))
    for length in range(len(whole)):
        assert decoder.check(whole[:length]) is None
    assert decoder.counters.malformed == len(whole)
    for at in range(len(whole)):
        for value in (0, 0xFF):
            packet = whole[:at] + bytes([value]) + whole[at + 1 :]
            if decoder.check(packet) is not None:
                decoder.add_packet(packet)
                decoder.drain()
    assert decoded(decoder, whole) is not None
    assert caplog.text.count("it is malformed") == 1


def test_a_cloud_without_a_time_is_malformed() -> None:
    message = DRIVER.message(1)
    message.header.stamp.sec = message.header.stamp.nanosec = 0
    decoder = RosCloudDecoder(INSTANT)
    payload = bytes(STORE.serialize_cdr(message, message.__msgtype__))
    assert decoder.check(DRIVER.attachment(1) + payload) is None
    assert decoder.counters.malformed == 1


def test_a_recording_s_sensor_finds_its_decoder() -> None:
    made = decoder_for("ros2", INSTANT)
    assert isinstance(made, RosCloudDecoder)
    assert (made.kind, made.metadata) == ("ros2", INSTANT)
