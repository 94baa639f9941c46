"""Windows of scans: formed by time stamps, from any epoch, never by arrival."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slz import LocalFrame, Scan, Window
from slz.window import LOST_M, PointAttributes, Windower, join

FRAME = LocalFrame(47.0, 8.0, 400.0)
MS = 1_000_000
BEGINNINGS_NS = [0, 7_777_777_777_777_777, -5_000_000_000]


def scan(first_ms: int, began_ns: int, n: int = 3, frame: LocalFrame = FRAME) -> Scan:
    """n returns a millisecond apart; east tells the millisecond."""
    ms = first_ms + np.arange(n)
    points = np.column_stack([ms, np.zeros((n, 2))]).astype(float)
    return Scan(points, began_ns + ms * MS, np.array([0.0, 0.0, float(first_ms)]), frame)


def east(window: Window | None) -> list[float]:
    assert window is not None
    return window.points_enu_m[:, 0].tolist()


@pytest.mark.parametrize("began_ns", BEGINNINGS_NS)
def test_the_scan_that_begins_at_the_window_s_end_begins_the_next(began_ns: int) -> None:
    windower = Windower(0.1)
    assert windower.add(scan(0, began_ns)) is None
    assert windower.add(scan(40, began_ns)) is None
    assert windower.add(scan(99, began_ns)) is None
    window = windower.add(scan(100, began_ns))
    assert east(window) == [0, 1, 2, 40, 41, 42, 99, 100, 101]
    assert window is not None
    assert (window.start_ns, window.end_ns) == (began_ns, began_ns + 101 * MS)
    assert window.sensor_enu_m[2] == 99
    assert windower.add(scan(199, began_ns)) is None
    assert east(windower.add(scan(200, began_ns))) == [100, 101, 102, 199, 200, 201]
    assert east(windower.flush()) == [200, 201, 202]
    assert windower.flush() is None


@pytest.mark.parametrize("began_ns", BEGINNINGS_NS)
def test_a_clock_that_steps_back_and_another_frame_end_a_window(began_ns: int) -> None:
    windower = Windower(1.0)
    windower.add(scan(2500, began_ns))
    assert east(windower.add(scan(499, began_ns))) == [2500, 2501, 2502]
    elsewhere = LocalFrame(46.0, 8.0, 400.0)
    assert east(windower.add(scan(510, began_ns, frame=elsewhere))) == [499, 500, 501]
    window = windower.add(scan(520, began_ns))
    assert window is not None
    assert window.frame == elsewhere


def test_a_second_sensor_s_late_scans_neither_open_nor_close_a_window() -> None:
    """A radar's block of eight lines is 0.8 s old when it is whole; windows near the ground last 0.5 s."""
    windower, windows = Windower(0.5), []
    for tick in range(200):
        windows.append(windower.add(scan(50 * tick, 0)))
        if tick % 16 == 15:
            windows.append(windower.add(scan(50 * tick - 790, 0, n=8)))
    found = [window for window in windows if window is not None]
    assert len(found) == 19
    ends = [window.end_ns for window in found]
    assert np.diff(ends).tolist() == [500 * MS] * 18
    late = [int((np.diff(window.stamp_ns) < 0).sum()) for window in found]
    assert sum(late) == 11  # none is lost; the last one is in the window that is open
    assert all(window.sensor_enu_m[2] * MS == window.end_ns - 2 * MS for window in found)
    assert found[1].start_ns < found[0].end_ns


def test_what_comes_late_waits_for_its_own_frame_only() -> None:
    windower = Windower(0.5)
    windower.add(scan(0, 0))
    windower.add(scan(600, 0))
    assert east(windower.flush()) == [600, 601, 602]
    assert windower.add(scan(400, 0)) is None
    assert windower.flush() is None
    windower.add(scan(700, 0, frame=LocalFrame(46.0, 8.0, 400.0)))
    assert east(windower.flush()) == [700, 701, 702]


def test_a_window_whose_stamps_stand_still_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slz.window.MOST_POINTS", 12)
    windower = Windower(1.0)
    lengths = [len(window) for _ in range(500) if (window := windower.add(scan(0, 0))) is not None]
    assert lengths[0] == 12
    assert sum(lengths) > 1000


def test_a_scan_without_a_return_is_no_part_of_anything() -> None:
    windower = Windower(0.1)
    assert windower.add(scan(5000, 0, n=0)) is None
    assert windower.flush() is None
    windower.add(scan(0, 0))
    assert windower.add(scan(5000, 0, n=0)) is None
    assert east(windower.flush()) == [0, 1, 2]


def test_a_span_that_was_lengthened_holds_for_what_is_being_gathered() -> None:
    windower = Windower(0.1)
    windower.add(scan(0, 0))
    windower.window_s = 0.2
    assert windower.add(scan(150, 0)) is None
    assert east(windower.add(scan(200, 0))) == [0, 1, 2, 150, 151, 152]


def test_scans_of_two_sensors_are_joined_in_their_order_and_the_newest_stamp_ends_them() -> None:
    window = join([scan(10, 0, n=8), scan(12, 0, n=2)])
    assert east(window) == [*range(10, 18), 12, 13]
    assert (window.start_ns, window.end_ns) == (10 * MS, 17 * MS)
    assert not window.points_enu_m.flags.writeable
    assert not window.stamp_ns.flags.writeable


def test_only_thin_rays_have_an_origin_that_proves_something() -> None:
    lidar, radar = scan(0, 0), replace(scan(50, 0), has_thin_rays=False)
    window = join([lidar, radar])
    assert window.origins_enu_m is not None
    assert window.thin_origins_enu_m is not None
    np.testing.assert_array_equal(window.thin_origins_enu_m[0], window.origins_enu_m[0])
    assert np.isnan(window.thin_origins_enu_m[1]).all()


def rated(first_ms: int, n: int = 3, lost: int = 2) -> Scan:
    """A scan whose intensities are its milliseconds, and whose lost rays end below them."""
    plain = scan(first_ms, 0, n)
    origin = np.tile(plain.sensor_enu_m, (lost, 1))
    lost_enu_m = origin - [0.0, 0.0, LOST_M]
    two = np.full(n, 2, np.uint8)
    intensity = plain.points_enu_m[:, 0].astype(np.float32)
    return replace(
        plain,
        attributes=PointAttributes.of(
            intensity, two - 1, two, lost_enu_m, origin, np.full(lost, 1 + lost, np.float32)
        ),
    )


def test_attributes_stay_with_their_returns_and_are_unknown_for_scans_without_any() -> None:
    plain = [scan(0, 0), scan(50, 0)]
    assert join(plain).attributes is None
    window = join([rated(0), scan(50, 0), rated(90, n=1, lost=1)])
    found = window.attributes
    assert found is not None
    np.testing.assert_array_equal(found.intensity, [0, 1, 2, *[np.nan] * 3, 90])
    assert found.echo.tolist() == [1, 1, 1, 0, 0, 0, 1]
    assert found.echoes.tolist() == [2, 2, 2, 0, 0, 0, 2]
    assert found.lost_enu_m[:, 2].tolist() == [-LOST_M, -LOST_M, 90 - LOST_M]
    assert found.lost_origin_enu_m[:, 2].tolist() == [0, 0, 90]
    assert found.lost_weight.tolist() == [3, 3, 2]
    assert not any(getattr(found, name).flags.writeable for name in PointAttributes.__slots__)


def test_attributes_leave_points_and_stamps_of_a_window_as_they_are() -> None:
    plain = join([scan(0, 0), scan(50, 0)])
    window = join([rated(0), rated(50)])
    np.testing.assert_array_equal(window.points_enu_m, plain.points_enu_m)
    np.testing.assert_array_equal(window.stamp_ns, plain.stamp_ns)


def test_return_numbers_that_contradict_each_other_are_unknown() -> None:
    echo, echoes = np.array([1, 2, 0, 2, 1, 0], np.uint8), np.array([1, 2, 2, 1, 0, 0], np.uint8)
    found = PointAttributes.of(np.zeros(6, np.uint8), echo, echoes)
    assert found.echo.tolist() == [1, 2, 0, 0, 0, 0]
    assert found.echoes.tolist() == [1, 2, 0, 0, 0, 0]
    assert found.intensity.dtype == np.float32
    assert echo.tolist() == [1, 2, 0, 2, 1, 0]


def test_lost_rays_of_a_window_whose_stamps_stand_still_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slz.window.MOST_LOST", 20)
    windower = Windower(1.0)
    windows = [window for _ in range(50) if (window := windower.add(rated(0, lost=5))) is not None]
    assert [len(window) for window in windows[:2]] == [12, 12]
