"""Which scans make a window: time stamps decide, wherever time began, and never the arrival."""

from __future__ import annotations

import numpy as np
import pytest

from slz import LocalFrame, Scan, Window
from slz.window import Windower, join

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
    windower.add(scan(500, began_ns))
    assert east(windower.add(scan(499, began_ns))) == [500, 501, 502]
    elsewhere = LocalFrame(46.0, 8.0, 400.0)
    assert east(windower.add(scan(510, began_ns, frame=elsewhere))) == [499, 500, 501]
    window = windower.add(scan(520, began_ns))
    assert window is not None
    assert window.frame == elsewhere


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
