"""Windows of scans: formed by time stamps, from any epoch, never by arrival."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

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


def east(*windows: Window | None) -> list[float]:
    (window,) = windows
    assert window is not None
    return window.points_enu_m[:, 0].tolist()


@pytest.mark.parametrize("began_ns", BEGINNINGS_NS)
def test_a_window_is_closed_with_the_last_scan_that_begins_within_its_span(began_ns: int) -> None:
    windower = Windower(0.1)
    for first_ms in (0, 50, 100, 150):
        found = windower.add(scan(first_ms, began_ns))
        if first_ms in (0, 100):
            assert found == ()
        else:
            assert east(*found) == [
                first_ms - 50,
                first_ms - 49,
                first_ms - 48,
                *range(first_ms, first_ms + 3),
            ]
            assert (found[0].start_ns, found[0].end_ns) == (
                began_ns + (first_ms - 50) * MS,
                began_ns + (first_ms + 2) * MS,
            )
            assert found[0].sensor_enu_m[2] == first_ms
    assert windower.flush() is None


def test_a_scan_as_long_as_the_window_is_one_at_once_however_its_turns_vary() -> None:
    """Turns of a spinning sensor take a little more or less than 0.1 s."""
    windower, first_ms = Windower(0.1), 0
    for turn_ms in (100, 99, 101, 104, 96, 100, 92, 108):
        assert len(windower.add(scan(first_ms, 0, n=turn_ms - 1))) == 1
        first_ms += turn_ms


def test_a_scan_that_is_late_ends_the_window_and_one_after_a_gap_begins_the_next() -> None:
    windower = Windower(0.1)
    for first_ms in (0, 50, 100):
        windower.add(scan(first_ms, 0))
    assert east(*windower.add(scan(230, 0))) == [100, 101, 102, 230, 231, 232]
    windower.add(scan(280, 0))
    assert east(*windower.add(scan(900, 0))) == [280, 281, 282]
    assert east(windower.flush()) == [900, 901, 902]


def test_a_window_that_nobody_awaits_grows_up_to_the_longest_span() -> None:
    windower = Windower(0.1, longest_s=0.3)
    for first_ms in (0, 50, 100, 150, 200):
        assert windower.add(scan(first_ms, 0), is_awaited=False) == ()
    assert windower.is_over(0.1)
    assert len(east(*windower.add(scan(250, 0), is_awaited=False))) == 18
    assert not windower.is_over(0.1)
    for first_ms in (300, 350):
        windower.add(scan(first_ms, 0), is_awaited=False)
    assert len(east(*windower.add(scan(400, 0)))) == 9


@pytest.mark.parametrize("began_ns", BEGINNINGS_NS)
def test_a_clock_that_steps_back_and_another_frame_end_a_window(began_ns: int) -> None:
    windower = Windower(1.0)
    windower.add(scan(2500, began_ns))
    assert east(*windower.add(scan(499, began_ns))) == [2500, 2501, 2502]
    elsewhere = LocalFrame(46.0, 8.0, 400.0)
    assert east(*windower.add(scan(510, began_ns, frame=elsewhere))) == [499, 500, 501]
    (window,) = windower.add(scan(520, began_ns))
    assert window.frame == elsewhere


def test_windows_go_on_at_once_after_the_clock_stepped_back_between_two_of_them() -> None:
    windower = Windower(0.1)
    assert len(windower.add(scan(90_000, 0, n=99))) == 1
    assert [len(windower.add(scan(first_ms, 0, n=99))) for first_ms in (0, 100, 200)] == [1, 1, 1]


def test_a_second_sensor_s_late_scans_neither_open_nor_close_a_window() -> None:
    """A radar's block of eight lines is 0.8 s old when it is whole; windows near the ground last 0.5 s."""
    windower, windows = Windower(0.5), list[Window]()
    for tick in range(200):
        windows += windower.add(scan(50 * tick, 0))
        if tick % 16 == 15:
            windows += windower.add(scan(50 * tick - 790, 0, n=8))
    assert len(windows) == 20
    assert np.diff([window.end_ns for window in windows]).tolist() == [500 * MS] * 19
    assert sum(map(len, windows)) == 200 * 3 + 12 * 8  # none is lost
    assert all(window.sensor_enu_m[2] * MS == window.end_ns - 2 * MS for window in windows)
    assert any(after.start_ns < before.end_ns for before, after in pairwise(windows))


def test_what_comes_late_waits_for_its_own_frame_only() -> None:
    windower = Windower(0.5)
    windower.add(scan(600, 0))
    assert east(windower.flush()) == [600, 601, 602]
    assert windower.add(scan(400, 0)) == ()
    assert windower.flush() is None
    windower.add(scan(700, 0, frame=LocalFrame(46.0, 8.0, 400.0)))
    assert east(windower.flush()) == [700, 701, 702]


def test_a_window_whose_stamps_stand_still_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slz.window.MOST_POINTS", 12)
    windower = Windower(1.0)
    lengths = [len(window) for _ in range(500) for window in windower.add(scan(0, 0))]
    assert lengths[0] == 12
    assert sum(lengths) > 1000


def test_a_scan_without_a_return_is_no_part_of_anything() -> None:
    windower = Windower(0.1)
    assert windower.add(scan(5000, 0, n=0)) == ()
    assert windower.flush() is None
    windower.add(scan(0, 0))
    assert windower.add(scan(5000, 0, n=0)) == ()
    assert east(windower.flush()) == [0, 1, 2]


def test_a_span_that_was_lengthened_holds_for_what_is_being_gathered() -> None:
    windower = Windower(0.1)
    windower.add(scan(0, 0))
    windower.window_s = 0.2
    assert windower.add(scan(50, 0)) == ()
    assert windower.add(scan(100, 0)) == ()
    assert len(east(*windower.add(scan(150, 0)))) == 12


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
    windows = [window for _ in range(50) for window in windower.add(rated(0, lost=5))]
    assert [len(window) for window in windows[:2]] == [12, 12]
