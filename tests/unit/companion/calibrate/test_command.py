"""`slz calibrate`: what it says of a flight, and of one that shows nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.calibrate import command
from companion.errors import CompanionError
from tests.fuzz.files import recordings
from tests.unit.companion.calibrate.test_agreement import figure_of_eight, flown, straight


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording with one message of each kind, and no flight in it."""
    path = tmp_path / "flight.mcap"
    path.write_bytes(recordings()[0])
    return path


def test_what_is_to_be_corrected_is_told_with_its_error_and_the_parameters_to_set(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = flown(figure_of_eight, "buildings", 40.0, (0.6, -0.7, 0.4), 15.0)
    monkeypatch.setattr(command, "_read", lambda *_: flight)
    told = command.run(recording, [])
    assert told["not_shown"] == []
    assert list(told["correction"].values()) == pytest.approx([0.6, -0.7, 0.4, 15.0], abs=1.0)
    assert told["parameters"]["lidar_delay_ms"] == pytest.approx(15.0, abs=1.0)
    assert told["after_m"] < told["before_m"]
    assert told["standard_error"].keys() == told["correction"].keys()


def test_what_the_flight_does_not_show_is_left_as_it_is(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = flown(straight, "plain", 20.0, (0.0, 0.0, 0.0), 0.0)
    monkeypatch.setattr(command, "_read", lambda *_: flight)
    told = command.run(recording, [])
    assert told["not_shown"]
    assert all(told["correction"][name] is None for name in told["not_shown"])


def test_ground_seen_once_is_refused_with_advice(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = flown(straight, "plain", 2.0, (0.0, 0.0, 0.0), 0.0)
    monkeypatch.setattr(command, "_read", lambda *_: flight)
    with pytest.raises(CompanionError, match=r"flight\.mcap: .*two passes.*; fly figures of eight"):
        command.run(recording, [])


def test_a_recording_without_a_flight_is_refused(recording: Path) -> None:
    with pytest.raises(CompanionError, match="no returns or no positions"):
        command.run(recording, [])
