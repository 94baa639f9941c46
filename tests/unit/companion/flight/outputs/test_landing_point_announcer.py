"""News of the selected point to the pilot: once, and at every change of its state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import params
from companion.flight.landing.situation import Severity
from companion.flight.outputs.announcers.landing_point_announcer import LandingPointAnnouncer
from slz import PointState, Report, SurfaceHere, SurfaceKind
from slz.landing_point.judgement import unknown
from slz.terrain.footing import Footing
from tests.unit.companion.flight.landing.flight import Flight

BARE, ROOF = SurfaceHere(SurfaceKind.BARE, 0.9), SurfaceHere(SurfaceKind.ROOF, 0.99, raised_m=25.2)
LAKE = SurfaceHere(SurfaceKind.WATER, 0.7, water=0.7)


def report(
    state: PointState | None, east: float = 0.0, judged_by: str = "near", surface: SurfaceHere = BARE
) -> Report:
    found = Flight([]).situation().report
    assert found is not None
    if state is None:
        return replace(found, selected=None)
    point = replace(unknown(np.array([east, 0.0, 0.0])), state=state, judged_by=judged_by, zone_id=7)
    return replace(found, selected=replace(point, surface=surface))


def test_a_point_that_turns_unsafe_is_told_at_once_and_once() -> None:
    announcer = LandingPointAnnouncer(params.build({}))
    assert announcer.update(report(PointState.SAFE)) == (
        Severity.NOTICE,
        "SLZ: landing point is safe in zone 7",
    )
    assert announcer.update(report(PointState.SAFE)) is None
    assert announcer.update(report(PointState.UNSAFE)) == (Severity.CRITICAL, "SLZ: landing point is UNSAFE")
    assert announcer.update(report(PointState.UNSAFE)) is None
    assert announcer.update(report(PointState.UNKNOWN)) == (Severity.WARNING, "SLZ: landing point is unknown")


def test_another_point_is_told_of_anew() -> None:
    announcer = LandingPointAnnouncer(params.build({}))
    assert announcer.update(report(PointState.SAFE)) is not None
    assert announcer.update(report(PointState.SAFE, east=5.0)) is not None
    assert announcer.update(report(None)) is None
    assert announcer.update(report(PointState.SAFE, east=5.0)) is not None


def test_what_only_the_far_map_knows_is_told_as_such() -> None:
    news = LandingPointAnnouncer(params.build({})).update(report(PointState.SAFE, judged_by="far"))
    assert news == (Severity.NOTICE, "SLZ: landing point is safe in zone 7, far map")


def test_the_texts_fit_a_statustext() -> None:
    for state in PointState:
        for judged_by in ("near", "far", "none"):
            news = LandingPointAnnouncer(params.build({})).update(report(state, judged_by=judged_by))
            assert news is not None
            assert len(news[1]) <= 50


def test_a_surface_other_than_bare_ground_is_named_and_told_of_when_it_shows() -> None:
    announcer = LandingPointAnnouncer(params.build({}))
    assert announcer.update(report(PointState.SAFE)) is not None
    news = announcer.update(report(PointState.SAFE, surface=ROOF))
    assert news == (Severity.NOTICE, "SLZ: landing point is safe in zone 7: roof, 25 m up")
    assert announcer.update(report(PointState.SAFE, surface=replace(ROOF, raised_m=24.1))) is None
    assert announcer.update(report(PointState.UNKNOWN, surface=ROOF)) is not None
    assert announcer.update(report(PointState.UNKNOWN, surface=BARE)) is None


def test_suspected_water_is_the_reason_of_an_unknown_point() -> None:
    announcer = LandingPointAnnouncer(params.build({}))
    assert announcer.update(report(PointState.UNKNOWN)) is not None
    news = announcer.update(report(PointState.UNKNOWN, surface=LAKE))
    assert news == (Severity.WARNING, "SLZ: landing point is unknown: may be water")
    news = announcer.update(report(PointState.UNSAFE, surface=LAKE))
    assert news == (Severity.CRITICAL, "SLZ: landing point is UNSAFE: may be water")


def test_what_keeps_the_vehicle_from_every_heading_is_told_without_its_numbers_repeated() -> None:
    announcer = LandingPointAnnouncer(params.build({}))
    told = []
    for blocked_by in (
        "tail: 1.2 m high at 4.0 m",
        "tail: 1.3 m high at 4.1 m",
        "rotor: unseen ground at 5.0 m",
    ):
        found = report(PointState.UNSAFE)
        assert found.selected is not None
        point = replace(found.selected, footing=Footing((), 0.0, blocked_by))
        told.append(announcer.update(replace(found, selected=point)))
    assert told == [
        (Severity.CRITICAL, "SLZ: landing point is UNSAFE: tail: 1.2 m high at 4.0 m"),
        None,
        (Severity.CRITICAL, "SLZ: landing point is UNSAFE: rotor: unseen ground at 5.0 m"),
    ]
