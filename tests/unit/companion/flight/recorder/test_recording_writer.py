"""Recording file: bounded, never blocking, and readable after any end."""

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from companion.desk.replay.recording_reader import RecordingReader
from companion.flight.recorder import foxglove_scene, journal, recording_writer, topics
from companion.flight.recorder.recording_writer import MIB, Entry, McapWriter
from companion.runtime.errors import UsageError
from params import Parameters

METADATA = {
    "version": "1",
    "lidar": "livox",
    "parameters": Parameters().model_dump_json(),
    "clock_offset_ns": "1000",
}


def open_writer(path: Path, most_bytes: int = 100 * MIB, **options: Any) -> McapWriter:
    return McapWriter(path, foxglove_scene.channels, most_bytes, METADATA, **options)


def frame(number: int, size: int = 100) -> Entry:
    return Entry(journal.MAVLINK_IN, 1000 + number, number.to_bytes(4, "little") + bytes(size), size)


def numbers(path: Path) -> list[int]:
    return [int.from_bytes(message.data[:4], "little") for message in RecordingReader(path).messages()]


def test_what_was_written_is_read_in_order_and_on_the_companion_s_clock(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    out = open_writer(path)
    assert all(out.put(frame(k)) for k in range(1000))
    out.close()
    assert numbers(path) == list(range(1000))
    assert [m.at_ns for m in RecordingReader(path).messages()] == list(range(1000))
    assert out.written == {journal.MAVLINK_IN: 1000}
    assert not out.dropped


def test_a_recording_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"the only copy")
    with pytest.raises(UsageError, match="there is one already"):
        open_writer(path)
    assert path.read_bytes() == b"the only copy"


def test_a_folder_that_is_not_there_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--record"):
        open_writer(tmp_path / "no" / "a.mcap")


def test_a_disk_that_stalls_costs_messages_and_no_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stalled = threading.Event()

    def stall() -> bytes:
        stalled.wait()
        return b"\0\0\0\0"

    monkeypatch.setattr(recording_writer, "MOST_WAITING_BYTES", 1000)
    out = open_writer(tmp_path / "a.mcap")
    out.put(Entry(journal.MAVLINK_IN, 1, stall, 1))
    taken = sum(out.put(frame(k)) for k in range(100))
    assert taken <= 21
    assert out.dropped[journal.MAVLINK_IN] == 100 - taken
    stalled.set()
    out.close()
    assert len(numbers(tmp_path / "a.mcap")) == 1 + taken


@pytest.mark.parametrize("limits", [{"most_bytes": 1}, {"least_free_bytes": 1 << 60}])
def test_it_ends_before_the_disk_is_full_and_says_so(
    tmp_path: Path, limits: dict[str, int], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recording_writer, "FLUSH_S", 0.01)
    out = open_writer(tmp_path / "a.mcap", **limits)
    wait_until(lambda: bool(out.ended))
    assert not out.put(frame(1))
    out.close()
    assert numbers(tmp_path / "a.mcap") == []
    assert "ended" in caplog.text


def test_a_disk_that_fails_ends_the_recording_and_what_comes_after_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_file: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(recording_writer, "FLUSH_S", 0.01)
    monkeypatch.setattr("companion.flight.recorder.recording_writer.os.fsync", fail)
    out = open_writer(tmp_path / "a.mcap")
    wait_until(lambda: bool(out.ended))
    assert not out.put(frame(1))
    out.close()
    assert out.ended == "writing failed: [Errno 5] Input/output error"
    assert out.dropped == {journal.MAVLINK_IN: 1}
    assert "Input/output error" in caplog.text


def test_a_message_that_cannot_be_made_costs_itself_only(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    out = open_writer(tmp_path / "a.mcap")
    for k in range(3):
        out.put(Entry(topics.ZONES, k, lambda: 1 / 0, 1))
        out.put(frame(k))
    out.close()
    assert numbers(tmp_path / "a.mcap") == [0, 1, 2]
    assert (out.dropped, out.ended) == ({topics.ZONES: 3}, "")
    assert caplog.text.count("cannot be made") == 1


def test_a_disk_that_hangs_does_not_hold_the_end_of_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs = threading.Event()
    monkeypatch.setattr(recording_writer, "CLOSE_S", 0.01)
    out = open_writer(tmp_path / "a.mcap")
    out.put(Entry(journal.MAVLINK_IN, 1, lambda: hangs.wait() and b"", 1))
    out.close()
    assert out.ended == "the disk does not answer"
    hangs.set()


def test_the_size_is_known_after_the_file_was_moved_away(tmp_path: Path) -> None:
    out = open_writer(tmp_path / "a.mcap")
    out.put(frame(1))
    (tmp_path / "a.mcap").rename(tmp_path / "b.mcap")
    out.close()
    assert out.size_bytes == (tmp_path / "b.mcap").stat().st_size


def test_after_a_kill_everything_up_to_the_last_second_is_there(tmp_path: Path) -> None:
    program = """
import os, sys
from pathlib import Path
from companion.flight.recorder import recording_writer as writer
from tests.unit.companion.flight.recorder.test_recording_writer import frame, open_writer, wait_until
writer.FLUSH_S = 0.05
path = Path(sys.argv[1])
out = open_writer(path)
for k in range(20):
    out.put(frame(k, 1000))
wait_until(lambda: out.written.total() == 20)
flushes = out.flushes
wait_until(lambda: out.flushes > flushes + 1)
os._exit(9)
"""
    path = tmp_path / "a.mcap"
    subprocess.run([sys.executable, "-c", program, str(path)], check=False, timeout=60)
    recording = RecordingReader(path)
    found = [int.from_bytes(m.data[:4], "little") for m in recording.messages()]
    assert found == list(range(20))
    assert "in the middle" in recording.cut


def wait_until(done: Callable[[], bool]) -> None:
    """Wait for another thread."""
    turn = threading.Event()
    for _ in range(1000):
        if done():
            return
        turn.wait(0.01)
    raise AssertionError("not in 10 s")
