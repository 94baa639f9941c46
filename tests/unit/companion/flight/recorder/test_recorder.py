"""Contents of a flight's recording, and its reports of losses."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from companion.desk.replay.recording_reader import RecordingReader
from companion.flight.geometry.pose import Pose
from companion.flight.link.vehicle_identity import VehicleIdentity
from companion.flight.recorder import foxglove_scene, journal, topics
from companion.flight.recorder.recorder import Recorder
from companion.flight.recorder.recording_writer import McapWriter
from companion.flight.recorder.recordings import Recordings
from companion.runtime.clock import now_ns
from params import Parameters
from slz import LocalFrame, MovingObject

FRAME = LocalFrame(47.0, 8.0, 400.0)


async def test_what_the_disk_was_too_slow_for_is_told_as_a_gap_before_what_comes_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(tmp_path / "a.mcap", "livox", Parameters(), 0)
    recorder.time_asked(1)
    with monkeypatch.context() as full:
        full.setattr(McapWriter, "put", lambda *_: False)
        for at_ns in (2, 3, 4):
            recorder.time_asked(at_ns)
    recorder.time_asked(5)
    recorder.close()
    kept = [(m.topic, json.loads(m.data)) for m in RecordingReader(tmp_path / "a.mcap").messages()]
    assert kept == [
        (journal.EVENT, {"time_asked_ns": 1}),
        (journal.GAP, {"lost": 3}),
        (journal.EVENT, {"time_asked_ns": 5}),
    ]


async def test_the_place_is_recorded_a_few_times_a_second_however_often_it_is_told(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", "livox", Parameters(), 0)
    pose = Pose(0, np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), 0)
    for _ in range(5):
        recorder.pose(pose, FRAME)
    recorder.changed("cell_m", 0.5)
    recorder.close()
    written = recorder.statistics()["written"]
    assert (written[topics.TRANSFORM], written[topics.FIX]) == (1, 1)
    assert written[topics.PARAMETERS] == 2  # those at the start, and the one changed


async def test_what_moves_is_recorded_where_it_is_at_the_time(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", "livox", Parameters(), 0)
    walker = MovingObject(7, now_ns(), np.array([4.0, 1.0]), np.array([0.0, 2.0]), 0.3, 1.7, ground_m=12.0)
    for objects in ((), (walker,), (walker,)):
        recorder.moving(objects)
    recorder.close()
    assert recorder.statistics()["written"][topics.MOVING] == 1
    drawn = repr(foxglove_scene.moving((walker,), walker.stamp_ns + 10**9, 0))
    assert "x: 4.0, y: 3.0, z: 12.85" in drawn
    assert "shaft_length: 4.0" in drawn


def recordings() -> Recordings:
    heard = SimpleNamespace(subscribe=lambda _take: lambda: None)
    link = SimpleNamespace(
        on_frame=heard,
        on_sent=heard,
        on_time_asked=heard,
        identity=None,
        inbox=SimpleNamespace(gate=SimpleNamespace(is_open=True)),
    )
    stream = SimpleNamespace(kind="livox", metadata="", batches=heard)
    worker = SimpleNamespace(on_window=heard)
    settings = SimpleNamespace(running=Parameters(), on_change=heard)
    given: Any = (link, stream, worker, settings, lambda: 0, None)
    return Recordings(*given)


async def test_each_start_records_into_a_file_of_its_own(tmp_path: Path) -> None:
    """The service starts with the same options every time, after a crash in flight too."""
    for _ in range(3):
        made = recordings()
        made.start_flight_recording(tmp_path / "flight.mcap")
        assert made.recorder is not None
        made.close()
    assert sorted(os.listdir(tmp_path)) == ["flight-2.mcap", "flight-3.mcap", "flight.mcap"]


@pytest.mark.parametrize("why", ["no folder", "full disk"])
async def test_what_cannot_be_recorded_is_flown_all_the_same(
    why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path if why == "full disk" else tmp_path / "stick"
    if why == "full disk":
        monkeypatch.setattr("shutil.disk_usage", lambda _folder: SimpleNamespace(free=1 << 20))
    made = recordings()
    made.start_flight_recording(folder / "flight.mcap")
    assert made.recorder is None
    assert "this flight is not recorded: --record" in caplog.text
    assert not os.listdir(tmp_path)


async def test_a_recording_tells_which_system_is_the_vehicle_and_whether_positions_waited_for_a_fix(
    tmp_path: Path,
) -> None:
    identity = VehicleIdentity(7, remembered=3)
    Recorder(tmp_path / "a.mcap", "livox", Parameters(), 0, "", 12, identity, gated=True).close()
    Recorder(tmp_path / "b.mcap", "livox", Parameters(), 0, "", 12, VehicleIdentity()).close()
    told = [RecordingReader(tmp_path / name).header for name in ("a.mcap", "b.mcap")]
    assert [(h.scans, h.system, h.remembered, h.gated) for h in told] == [
        (12, 7, 3, True),
        (12, None, None, False),
    ]
