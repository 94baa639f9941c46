"""Recordings that are invalid or incomplete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.desk.replay.recorder_clock import fitting_offset
from companion.desk.replay.recording_reader import RecordingReader
from companion.flight.recorder import foxglove_scene
from companion.flight.recorder.recording_writer import MIB, McapWriter
from companion.runtime.errors import UsageError
from tests.unit.companion.flight.recorder.test_recording_writer import METADATA, frame, open_writer


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "a.mcap"
    out = open_writer(path)
    for k in range(300):
        out.put(frame(k, k))
    out.close()
    return path


def read(path: Path) -> list[int]:
    return [int.from_bytes(m.data[:4], "little") for m in RecordingReader(path).messages()]


def is_a_beginning_or_refused(path: Path) -> bool:
    try:
        found = read(path)
    except UsageError as error:
        return str(path) in str(error)
    return found == list(range(len(found)))


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_recording_cut_off_anywhere_gives_what_is_before_or_one_clear_error(
    whole: Path, tmp_path: Path, share: float
) -> None:
    path = tmp_path / "cut.mcap"
    content = whole.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    assert is_a_beginning_or_refused(path)


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 10_000), bit=st.integers(0, 7))
def test_a_flipped_bit_is_found_or_does_no_harm(whole: Path, tmp_path: Path, at: int, bit: int) -> None:
    path = tmp_path / "flipped.mcap"
    bad = bytearray(whole.read_bytes())
    bad[at % len(bad)] ^= 1 << bit
    path.write_bytes(bad)
    assert is_a_beginning_or_refused(path)


@pytest.mark.parametrize("content", [b"", b"nonsense", b"\x89MCAP0\r\n", bytes(5000)])
def test_what_is_no_recording_is_one_clear_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=r"is no MCAP file|no recording of slz"):
        RecordingReader(path)
    with pytest.raises(UsageError, match="cannot be read"):
        RecordingReader(tmp_path)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"version": "2"}, "version 2"),
        ({"version": "x"}, "metadata"),
        ({"parameters": "{"}, "metadata"),
        ({"parameters": "[1]"}, "metadata"),
        ({"parameters": '{"cell_m": -1}'}, "cell_m"),
        ({"clock_offset_ns": ""}, "metadata"),
    ],
)
def test_metadata_that_cannot_be_used_is_one_clear_line(
    tmp_path: Path, changed: dict[str, str], says: str
) -> None:
    path = tmp_path / "a.mcap"
    McapWriter(path, foxglove_scene.channels, MIB, METADATA | changed).close()
    with pytest.raises(UsageError, match=says):
        RecordingReader(path)


def test_an_old_name_of_a_parameter_in_a_recording_is_read_as_today_s(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    old = METADATA | {"parameters": '{"max_slope_deg": 30}'}
    McapWriter(path, foxglove_scene.channels, MIB, old).close()
    assert RecordingReader(path).header.parameters().worst_slope_deg == 30


def test_a_recording_keeps_the_sensor_s_description_and_older_ones_have_none(tmp_path: Path) -> None:
    new, old = tmp_path / "new.mcap", tmp_path / "old.mcap"
    described = METADATA | {"lidar": "ouster", "lidar_setup": '{"rows": 128}'}
    McapWriter(new, foxglove_scene.channels, MIB, described).close()
    McapWriter(old, foxglove_scene.channels, MIB, METADATA).close()
    assert (RecordingReader(new).header.lidar, RecordingReader(new).header.lidar_metadata) == (
        "ouster",
        '{"rows": 128}',
    )
    assert RecordingReader(old).header.lidar_metadata == ""


def test_a_recording_of_which_only_the_last_bytes_are_spoiled_is_read_as_a_whole(
    whole: Path, tmp_path: Path
) -> None:
    path = tmp_path / "spoiled.mcap"
    path.write_bytes(whole.read_bytes()[:-8] + b"nonsense")
    recording = RecordingReader(path)
    assert len(list(recording.messages())) == 300
    assert recording.cut == ""


# Offsets between the clocks of points and log, named where they are usual.


S = 1_000_000_000
BEGIN = 1_750_000_000
LOG = BEGIN * S, (BEGIN + 300) * S
WEEK, HOUR = 604_800, 3600


@pytest.mark.parametrize(
    ("early_s", "says"),
    [
        (1024 * WEEK, r"\+1 x 1024 weeks"),
        (2048 * WEEK, r"\+2 x 1024 weeks"),
        (-1024 * WEEK, "-1 x 1024 weeks"),
        (1024 * WEEK + 18, r"\+1 x 1024 weeks .* and \+18 s \(leap"),
        (315_964_800, r"\+1 x the epoch of GPS"),
        (315_964_800 - 18, r"\+1 x the epoch of GPS .* and -18 s \(leap"),
        (1_000_000_000, r"\+1 x 1e9 s"),
        (3 * WEEK, r"\+3 weeks"),
        (86_400, r"\+1 days"),
        (2 * HOUR, r"\+2 hours \(a time zone\)"),
        (-7 * HOUR, "-7 hours"),
        (HOUR * 5.5, r"\+22 quarters of an hour"),
        (777.0, r"\+777.0 s would fit"),
    ],
)
def test_the_offset_that_fits_is_named(early_s: float, says: str) -> None:
    points = LOG[0] + 10 * S - round(early_s * S), LOG[1] - 10 * S - round(early_s * S)
    assert re.search(says, fitting_offset(points, LOG))


def test_leap_seconds_are_named_where_the_log_is_as_long_as_the_points() -> None:
    points = LOG[0] - 18 * S, LOG[1] - 18 * S
    assert "+18 s (leap seconds)" in fitting_offset(points, LOG)
