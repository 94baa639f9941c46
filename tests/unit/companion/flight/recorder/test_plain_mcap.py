"""Plain MCAP: read by mcap's own reader, and like what Foxglove's library writes."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.stream_reader import StreamReader

from companion.desk.replay.recording_reader import RecordingReader
from companion.flight.recorder import foxglove_scene, journal
from companion.flight.recorder.plain_mcap import CHANNELS, PlainMcap
from companion.flight.recorder.recording_writer import MIB, Entry, McapWriter
from companion.runtime.errors import UsageError
from tests.unit.companion.flight.recorder.test_recording_writer import METADATA, frame, numbers

CHUNK_BYTES = 4096


def test_messages_are_read_in_order_across_chunks(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    out = McapWriter(path, None, 100 * MIB, METADATA)
    assert all(out.put(frame(k, 5000)) for k in range(600))  # three chunks
    out.close()
    assert numbers(path) == list(range(600))
    reader = RecordingReader(path)
    assert [message.at_ns for message in reader.messages()] == list(range(600))
    assert reader.cut == ""
    assert reader.header.lidar == "livox"


def test_channels_are_those_of_foxglove_s_library(tmp_path: Path) -> None:
    def described(name: str) -> dict[str, tuple[object, ...]]:
        with (tmp_path / name).open("rb") as file:
            records = list(StreamReader(file, validate_crcs=True).records)
        schemas = {r.id: (r.name, r.encoding, r.data) for r in records if type(r).__name__ == "Schema"}
        channels = [r for r in records if type(r).__name__ == "Channel"]
        return {c.topic: (c.message_encoding, *schemas[c.schema_id]) for c in channels if c.topic in CHANNELS}

    for name, channels in (("plain.mcap", None), ("foxglove.mcap", foxglove_scene.channels)):
        out = McapWriter(tmp_path / name, channels, MIB, METADATA)
        for topic in CHANNELS:
            out.put(Entry(topic, 1, b"{}", 2))
        out.close()
    plain = described("plain.mcap")
    assert plain == described("foxglove.mcap")
    assert set(plain) == set(CHANNELS) >= journal.TOPICS


def test_a_file_that_was_not_closed_holds_its_flushed_chunks(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    out = PlainMcap(path, CHUNK_BYTES)
    out.write_metadata("slz", METADATA)
    channel = out.channels()[journal.MAVLINK_IN]
    for k in range(3):
        channel.log(k.to_bytes(4, "little"), log_time=1000 + k)
    out.flush()
    channel.log(b"lost", log_time=2000)
    assert numbers(path) == [0, 1, 2]
    out.close()


def test_an_existing_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"the only copy")
    with pytest.raises(FileExistsError):
        PlainMcap(path, CHUNK_BYTES)
    with pytest.raises(UsageError, match="there is one already"):
        McapWriter(path, None, MIB, METADATA)
    assert path.read_bytes() == b"the only copy"
