"""News of wires to the pilot: once for each, when it matters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from companion.flight.landing.situation import Severity
from companion.flight.outputs.announcers.wire_announcer import WireAnnouncer
from slz import LocalFrame, Nearby, Report, Wire
from slz.landing_point.judgement import unknown
from slz.wires.detected_wire import SaggingCurve
from tests.unit.companion.flight.landing.flight import Flight


def wire(number: int, east_m: float) -> Wire:
    """Return a wire from south to north."""
    curve = SaggingCurve(
        np.array([east_m, 0.0]), np.array([0.0, 1.0]), np.array([9.0, 0.0, 0.0]), np.eye(3), 0.1, 1.0
    )
    return Wire(number, curve, -20.0, 20.0, -20.0, 20.0, (False, False), 20, 0, 0)


def report(*wires: Wire, point_east_m: float | None = None) -> Report:
    """Return a report of a vehicle over the origin."""
    found = Flight([]).situation().report
    assert found is not None
    level = np.zeros((120, 120), np.float32)
    selected = None if point_east_m is None else unknown(np.array([point_east_m, 0.0, 0.0]))
    return replace(
        found, wires=wires, selected=selected, nearby=Nearby(-30.0, -30.0, 0.5, level, level, level > 0)
    )


def test_a_wire_is_told_once() -> None:
    announcer = WireAnnouncer()
    assert announcer.update(report()) is None
    told = announcer.update(report(wire(1, 23.0)))
    assert told == (Severity.WARNING, "SLZ: wire 23 m away, bearing 090")
    assert len(told[1]) <= 50
    assert announcer.update(report(wire(1, 12.0))) is None


def test_a_wire_that_is_found_again_is_not_told_again() -> None:
    announcer = WireAnnouncer()
    assert announcer.update(report(wire(1, 23.0)))
    assert announcer.update(report(wire(2, 24.0))) is None
    assert announcer.update(report(wire(3, 31.0)))


def test_the_nearest_of_several_is_told_and_the_others_counted() -> None:
    told = WireAnnouncer().update(report(wire(1, 30.0), wire(2, -8.0), wire(3, 39.0)))
    assert told == (Severity.WARNING, "SLZ: wire 8 m away, bearing 270, 2 more")


@pytest.mark.parametrize(("point_east_m", "is_told"), [(None, False), (20.0, False), (88.0, True)])
def test_a_far_wire_is_told_near_the_landing_point_only(point_east_m: float | None, is_told: bool) -> None:
    assert (WireAnnouncer().update(report(wire(1, 100.0), point_east_m=point_east_m)) is not None) == is_told


def test_a_new_frame_has_new_wires() -> None:
    announcer = WireAnnouncer()
    assert announcer.update(report(wire(1, 23.0)))
    assert announcer.update(replace(report(wire(1, 23.0)), frame=LocalFrame(1.0, 2.0, 3.0)))


def test_without_the_place_of_the_vehicle_nothing_is_told() -> None:
    assert WireAnnouncer().update(replace(report(wire(1, 5.0)), nearby=None)) is None
