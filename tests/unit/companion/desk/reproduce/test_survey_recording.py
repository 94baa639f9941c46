"""Windows of a recorded survey, and what they hold besides points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.desk.reproduce.survey_recording import RecordedSurface, SurveyFlight, SurveyRecording, fly
from slz import SurfaceKind, Window

SURVEY = SurveyFlight("ponds", (-20.0, -20.0, 20.0, 20.0), speed_ms=20.0, point_rate_hz=20_000, cell_m=0.5)
COUNT = np.array([3, 0, 2, *[1] * 7, *[0] * 9, 4])
LOST = np.array([1, 2, 0, *[0] * 7, *[0] * 9, 3])


def ramp(n: int, columns: int = 3) -> np.ndarray:
    """Return rows that all differ."""
    return np.arange(n * columns, dtype=np.float32).reshape(n, columns)


def recording() -> SurveyRecording:
    """Return two seconds: no return in the second scan, and in the last ten scans but the last."""
    n, lost, raster = int(COUNT.sum()), int(LOST.sum()), np.zeros((4, 4), np.float32)
    surface = RecordedSurface(
        bright=np.linspace(0.1, 0.9, n, dtype=np.float32),
        lost_enu_m=-ramp(lost),
        lost_origin_enu_m=ramp(lost) + 100,
        lost_weight=np.arange(1, lost + 1, dtype=np.float32),
        lost_count=LOST,
        kind=np.ones((4, 4), np.uint8),
        names={"BARE": 1},
        roof_height_m=raster,
    )
    return SurveyRecording(
        replace(SURVEY, surface=True),
        ramp(n),
        np.arange(n) * 10**6,
        np.arange(3.0 * len(COUNT)).reshape(-1, 3),
        COUNT,
        np.zeros((4, 4), np.uint8),
        *[raster] * 3,
        {},
        "made by hand",
        surface,
    )


def first_and_last(one: SurveyRecording) -> tuple[Window, Window]:
    first, last = one.windows()
    return first, last


def test_windows_hold_brightness_and_lost_rays_of_their_scans() -> None:
    one = recording()
    assert one.surface is not None
    first, last = first_and_last(one)
    for window, returns, lost in ((first, slice(0, 12), slice(0, 3)), (last, slice(12, 16), slice(3, 6))):
        told = window.attributes
        assert told is not None
        np.testing.assert_array_equal(told.intensity, one.surface.bright[returns])
        np.testing.assert_array_equal(told.lost_enu_m, one.surface.lost_enu_m[lost])
        np.testing.assert_array_equal(told.lost_origin_enu_m, one.surface.lost_origin_enu_m[lost])
        np.testing.assert_array_equal(told.lost_weight, one.surface.lost_weight[lost])
        assert not told.echo.any()


def test_returns_keep_the_sensor_s_position_in_their_scan() -> None:
    first, last = first_and_last(recording())
    assert first.origin is not None
    assert first.origins_enu_m is not None
    places = first.origins_enu_m[first.origin]
    np.testing.assert_array_equal(places[:5, 0], [0, 0, 0, 6, 6])
    np.testing.assert_array_equal(last.sensor_enu_m, [57, 58, 59])


def test_without_evidence_windows_have_no_attributes() -> None:
    one = replace(recording(), surface=None)
    assert [window.attributes for window in one.windows()] == [None, None]
    assert [len(window) for window in one.windows()] == [12, 4]


def test_only_surveys_of_the_surface_ask_for_it() -> None:
    assert "--surface" not in SURVEY.options()
    assert "--surface" in replace(SURVEY, surface=True).options()


@pytest.mark.parametrize("surface", [False, True])
def test_a_flown_survey_holds_what_was_asked_for(surface: bool, tmp_path: Path) -> None:
    one = fly(replace(SURVEY, surface=surface), tmp_path)
    assert (one.surface is not None) == surface
    if one.surface is not None:
        assert {SurfaceKind.WATER.name, "OBJECT"} <= set(one.surface.names)
        assert len(one.surface.bright) == len(one.points_enu_m)
        assert sum(len(w.attributes.lost_weight) for w in one.windows() if w.attributes) > 100
