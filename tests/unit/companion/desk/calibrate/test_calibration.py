"""`slz calibrate`: its report of a flight, and of one that determines nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

import params
from companion.desk.calibrate import calibration
from companion.flight.recorder import journal
from companion.runtime.errors import CompanionError
from tests.fuzz.files import recordings
from tests.unit.companion.desk.calibrate.test_overlap_agreement import figure_of_eight, flown, straight
from tests.unit.companion.flight.link.messages import attitude, heartbeat, position
from tests.unit.companion.flight.sensors.packets import points_packet

S = 1_000_000_000


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
    monkeypatch.setattr(calibration, "_read", lambda *_: flight)
    told = calibration.run(recording, [])
    assert told["not_shown"] == []
    assert list(told["correction"].values()) == pytest.approx([0.6, -0.7, 0.4, 15.0], abs=1.0)
    assert told["parameters"]["lidar_delay_ms"] == pytest.approx(15.0, abs=1.0)
    assert told["after_m"] < told["before_m"]
    assert told["standard_error"].keys() == told["correction"].keys()


def test_what_the_flight_does_not_show_is_left_as_it_is(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = flown(straight, "plain", 12.0, (0.0, 0.0, 0.0), 0.0)
    monkeypatch.setattr(calibration, "_read", lambda *_: flight)
    told = calibration.run(recording, [])
    assert told["not_shown"]
    assert all(told["correction"][name] is None for name in told["not_shown"])


def test_ground_seen_once_is_refused_with_advice(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = flown(straight, "plain", 2.0, (0.0, 0.0, 0.0), 0.0)
    monkeypatch.setattr(calibration, "_read", lambda *_: flight)
    with pytest.raises(CompanionError, match=r"flight\.mcap: .*two passes.*; fly figures of eight"):
        calibration.run(recording, [])


def test_a_recording_without_a_flight_is_refused(recording: Path) -> None:
    with pytest.raises(CompanionError, match="no returns or no positions"):
        calibration.run(recording, [])


def test_a_flight_that_shows_nothing_well_enough_is_refused_with_advice(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = flown(straight, "plain", 12.0, (0.0, 0.0, 0.0), 0.0)
    monkeypatch.setattr(calibration, "_read", lambda *_: flight)
    monkeypatch.setattr(calibration, "BELIEVED", np.zeros(4))
    with pytest.raises(CompanionError, match="does not show boresight or time offset; fly figures of eight"):
        calibration.run(recording, [])


def recorded(path: Path, *, range_mm: int = 5000, attitudes: bool = True, broken: int = 0) -> Path:
    """Write a recording of a vehicle that hovers for a second and sees one spot again and again."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        values = json.dumps({row.name: row.default for row in params.rows()})
        told = {"version": "1", "lidar": "livox", "clock_offset_ns": "0", "parameters": values}
        writer.add_metadata(journal.METADATA, told)
        topics = {topic: writer.register_channel(topic, "", 0) for topic in sorted(journal.TOPICS)}

        def add(topic: str, at_ns: int, data: bytes) -> None:
            writer.add_message(topics[topic], at_ns, data, at_ns)

        for _ in range(broken):
            add(journal.MAVLINK_IN, 0, b"\xfd\x01")
        for k in range(50):
            at_ns = 60 * S + k * 20_000_000
            poses = [position(1000 + 20 * k), *([attitude(1000 + 20 * k)] if attitudes else [])]
            for message in ([heartbeat()] if k == 0 else []) + poses:
                add(journal.MAVLINK_IN, at_ns, bytes(message.get_msgbuf()))
            packet = points_packet([(range_mm, 0, 0, 9, 0)] * 10, stamp_ns=at_ns, interval_ns=0, count=k)
            add(journal.LIDAR, at_ns, journal.pack_batch([(at_ns, packet)]))
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize("broken", [0, 3])
def test_a_recording_is_read_and_what_of_it_cannot_be_read_is_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, broken: int
) -> None:
    with pytest.raises(CompanionError, match=r"flight\.mcap: no ground is seen in two passes"):
        calibration.run(recorded(tmp_path / "flight.mcap", broken=broken), [])
    told = [f"{broken} messages cannot be read and are left out"] if broken else []
    assert [record.getMessage() for record in caplog.records if "cannot be read" in record.msg] == told


@pytest.mark.parametrize("flight", [{"range_mm": 10}, {"attitudes": False}])
def test_a_recording_without_a_return_that_can_be_placed_is_refused(
    tmp_path: Path, flight: dict[str, Any]
) -> None:
    with pytest.raises(CompanionError, match="no return that is in range and has a pose"):
        calibration.run(recorded(tmp_path / "flight.mcap", **flight), [])
