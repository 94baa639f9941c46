"""Replay of a flight recorded by slz: the same zones, and incomplete recordings."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.desk.replay import replay_run
from companion.desk.replay.own_replay import Replay
from companion.desk.replay.recording_reader import Raw, RecordingReader
from companion.desk.replay.recording_type import RecordingOptions
from companion.flight.recorder import journal
from companion.flight.recorder.recorder import Recorder
from companion.runtime.errors import UsageError
from slz import Pipeline
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import HEADER, PARAMETERS, window, write_own

ALL_S = (0.0, 1e9)


@cache
def flight() -> tuple[Raw, ...]:
    """Return a flight with windows of a second."""
    return tuple(flights.with_windows(flights.recorded()))


def windows() -> list[int]:
    """Return when the flight's windows were, in ns since its first message."""
    return [m.at_ns - flight()[0].at_ns for m in flight() if m.topic == journal.EVENT]


def begun(scans: int) -> Replay:
    """Return a replay that has taken the flight without its windows, until so many scans may be asked for."""
    replay = Replay(HEADER, PARAMETERS)
    for message in flight():
        if message.topic not in (journal.EVENT, journal.REPORT):
            replay.process_message(message)
    assert 20 * len(windows()) >= scans
    return replay


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_own(tmp_path_factory.mktemp("own") / "flight.mcap", list(flight()))


@pytest.fixture(autouse=True)
def _cold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every test compile what it needs only."""
    monkeypatch.setattr(replay_run, "warm_up", lambda _parameters: None)


def again(path: Path, **more: Any) -> dict[str, Any]:
    asked: dict[str, Any] = {"settings": [], "out": None, "speed": 0.0, "span_s": ALL_S}
    return replay_run.run(path, **(asked | more))


def test_a_flight_run_again_gives_the_same_zones_to_the_last_bit(path: Path) -> None:
    told: list[str] = []
    summary = again(path, step=lambda _at_s, text: told.append(text))
    assert summary["windows"] == summary["identical"] == len(windows()) == len(told) >= 3
    assert (summary["different"], summary["first_different_ns"], summary["without_scans"]) == (0, None, 0)
    assert (summary["lidar_faults"], summary["warnings"]) == ([], [])
    assert summary["zones"]
    assert summary["files"] == {}


@pytest.mark.parametrize(("settings", "certainty"), [([], 0.99), (["min_certainty=0.5"], 0.5)])
def test_a_parameter_changed_in_flight_is_changed_in_the_replay_unless_it_was_given(
    settings: list[str], certainty: float
) -> None:
    replay = Replay(HEADER, HEADER.parameters(settings))
    replay.process_message(window(0, 1, 20, min_certainty=0.99))
    assert replay.pipeline.parameters.min_certainty == certainty


def test_another_setting_gives_other_reports_and_the_first_is_told(path: Path) -> None:
    summary = again(path, settings=["cell_m=0.7"])
    assert (summary["identical"], summary["different"]) == (0, summary["windows"])
    first = next(m for m in flight() if m.topic == journal.REPORT)
    assert summary["first_different_ns"] == json.loads(first.data)["stamp_ns"]
    assert summary["set"] == ["cell_m=0.7"]


def test_only_windows_within_the_span_are_mapped(path: Path) -> None:
    second, third = (windows()[k] * 1e-9 for k in (1, 2))
    summary = again(path, span_s=(second - 0.001, third - 0.001))
    assert (summary["windows"], summary["identical"], summary["different"]) == (1, 0, 1)
    assert again(path, span_s=(0.0, second - 0.001))["windows"] == 1
    assert again(path, span_s=(1e6, 1e7))["windows"] == 0


def test_at_a_speed_it_waits_for_the_time_of_every_message(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now_s=100.0)

    def sleep(seconds: float) -> None:
        clock.now_s += seconds

    monkeypatch.setattr(replay_run, "time", SimpleNamespace(monotonic=lambda: clock.now_s, sleep=sleep))
    again(path, speed=2.0, span_s=(1e6, 1e7))
    length_s = (flight()[-1].at_ns - flight()[0].at_ns) * 1e-9
    assert clock.now_s - 100.0 == pytest.approx(length_s / 2)
    again(path, speed=0.0, span_s=(1e6, 1e7))
    assert clock.now_s - 100.0 == pytest.approx(length_s / 2)


def test_the_maps_at_the_end_are_drawn_with_the_way_flown(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []

    def save_flight(out: Path, *drawn: Any) -> list[Path]:
        given.extend(drawn)
        return [out / "dsm.png", out / "safe.png"]

    monkeypatch.setattr("companion.desk.figures.save_flight", save_flight)
    summary = again(path, out=tmp_path / "out")
    assert summary["files"] == {name: str(tmp_path / "out" / f"{name}.png") for name in ("dsm", "safe")}
    maps, zones, flown, chosen, _, parameters = given
    assert np.isfinite(maps.height_m).any()
    assert len(zones) == len(summary["zones"])
    assert flown.shape == (summary["windows"], 3)
    assert chosen is None
    assert parameters.cell_m == PARAMETERS.cell_m


def test_nothing_is_drawn_of_a_flight_that_saw_nothing(tmp_path: Path) -> None:
    blind = [m for m in flight() if m.topic == journal.MAVLINK_IN]
    summary = again(write_own(tmp_path / "blind.mcap", blind), out=tmp_path / "out")
    assert (summary["windows"], summary["zones"], summary["choice"], summary["files"]) == (0, [], None, {})


def test_a_recording_that_ended_before_its_first_message_is_one_line(tmp_path: Path) -> None:
    path = write_own(tmp_path / "empty.mcap", [])
    with pytest.raises(UsageError, match=r"empty\.mcap holds no message to replay"):
        again(path)


@pytest.mark.parametrize(
    "options",
    [RecordingOptions(points="/points"), RecordingOptions(lidar="livox"), RecordingOptions(origin="1,2,3")],
)
def test_what_other_recordings_need_is_refused_beside_our_own(path: Path, options: RecordingOptions) -> None:
    with pytest.raises(UsageError, match="leave out --points"):
        again(path, options=options)


def test_a_window_whose_scans_were_lost_is_counted_and_its_report_not_compared() -> None:
    replay = begun(scans=10)
    assert replay.process_message(window(0, 1000, 1009)) is None
    assert replay.process_message(Raw(journal.REPORT, 0, b"{}")) is None
    outcome = replay.outcome
    assert (outcome.without_scans, outcome.windows, outcome.same, outcome.other) == (1, 0, 0, 0)
    assert replay.process_message(window(0, 1, 10)) is not None
    assert outcome.windows == 1


async def test_a_recording_begun_in_flight_goes_on_from_the_scans_before_it(tmp_path: Path) -> None:
    """Windows name their scans by the flight's count, which the recording tells."""
    replay = Replay(replace(HEADER, scans=4000), PARAMETERS)
    for message in flight():
        if message.topic not in (journal.EVENT, journal.REPORT):
            replay.process_message(message)
    assert replay.process_message(window(0, 1, 10)) is None
    assert replay.process_message(window(0, 4001, 4010)) is not None
    recorder = Recorder(tmp_path / "a.mcap", "livox", PARAMETERS, 0, "", 4000)
    recorder.close()
    assert RecordingReader(tmp_path / "a.mcap").header.scans == 4000


def test_a_map_that_was_begun_anew_in_flight_is_begun_anew() -> None:
    replay = begun(scans=20)
    assert replay.process_message(window(0, 1, 10)) is not None
    assert replay.maps() is not None
    assert replay.process_message(window(0, 11, 20, anew=True), mapping=False) is None
    assert replay.maps() is None
    assert replay.outcome.windows == 1


def test_only_the_first_report_that_differs_is_told_by_its_time() -> None:
    replay = begun(scans=20)
    for stamp_ns, first in ((7, 1), (8, 11)):
        report = replay.process_message(window(0, first, first + 9))
        assert report is not None
        other = journal.report_document(replace(report, stamp_ns=stamp_ns))
        replay.process_message(Raw(journal.REPORT, 0, other))
    assert (replay.outcome.same, replay.outcome.other, replay.outcome.first_other_ns) == (0, 2, 7)


def test_a_window_that_the_pipeline_fails_on_is_counted_and_the_next_is_mapped(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    replay = begun(scans=20)

    def fail(_pipeline: Pipeline, _window: Any) -> Any:
        raise ArithmeticError("planted")

    with monkeypatch.context() as patch:
        patch.setattr(Pipeline, "process", fail)
        assert replay.process_message(window(0, 1, 10)) is None
    assert "planted" in caplog.text
    assert replay.process_message(window(0, 11, 20)) is not None
    assert (replay.outcome.windows, replay.outcome.failed) == (2, 1)
    assert len(replay.outcome.path_enu_m) == 1


def test_what_the_recorder_lost_is_added_up() -> None:
    replay = begun(scans=0)
    for lost in (3, 4):
        replay.process_message(Raw(journal.GAP, 0, b'{"lost": %d}' % lost))
    assert replay.outcome.lost == 7


def test_a_pause_of_the_lidar_is_named_with_its_remedy(tmp_path: Path) -> None:
    begin_ns = flight()[0].at_ns
    silent = [m for m in flight() if m.topic != journal.LIDAR or not 3.0 < (m.at_ns - begin_ns) * 1e-9 < 4.2]
    summary = again(write_own(tmp_path / "paused.mcap", silent))
    (fault,) = summary["lidar_faults"]
    assert (fault["cause"], fault["text"]) == ("pauses", "LiDAR paused for 1.2 s")
    assert f"LiDAR: {fault['line']}" in summary["warnings"]
