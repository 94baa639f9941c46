"""Recognition of frames that are delivered more than once."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.wire.codec import Codec
from companion.flight.link.wire.repeated_frames import RepeatedFrames
from tests.unit.companion.flight.link.messages import attitude, heartbeat, received

MS, S = 1_000_000, 1_000_000_000


def test_the_bytes_of_a_frame_that_was_read_are_a_copy_for_ten_seconds() -> None:
    frames = RepeatedFrames()
    assert [frames.is_copy(heartbeat(sequence=n), n * S // 5) for n in (3, 4, 5)] == [False] * 3
    for late_ns in (0, 300 * MS, 5 * S):
        assert frames.is_copy(heartbeat(sequence=3), S + late_ns)
    assert not frames.is_copy(heartbeat(sequence=3), 30 * S)
    assert (frames.copies, frames.old_copies) == (3, 1)


def test_other_bytes_another_number_or_another_sender_are_no_copy() -> None:
    frames = RepeatedFrames()
    heard = [
        heartbeat(sequence=3),
        heartbeat(sequence=4),
        heartbeat(sequence=3, custom_mode=9),
        heartbeat(sequence=3, system=2),
    ]
    assert not any(frames.is_copy(message, S) for message in heard)


def test_a_heartbeat_with_the_number_of_the_last_one_is_heard_where_all_frames_between_were() -> None:
    """An autopilot that sends 256 frames a second: each of its heartbeats has the same number and bytes."""
    frames = RepeatedFrames()
    for n in range(256 * 4):
        message = heartbeat(sequence=0) if n % 256 == 0 else attitude(n)
        message = received(message, sequence=n % 256)
        assert not frames.is_copy(message, n * S // 256)


def test_a_sender_that_does_not_count_is_heard_each_time() -> None:
    frames = RepeatedFrames()
    assert not any(frames.is_copy(heartbeat(sequence=7), n * S) for n in range(30))


def test_a_link_reads_a_frame_once_and_counts_no_loss_for_its_copies() -> None:
    source, codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), Codec(191)
    sent = []
    for n in range(400):
        sent.append(bytes(mavlink.MAVLink_system_time_message(0, n * 10).pack(source)))
        source.seq = (source.seq + 1) % 256
    read = [
        message.time_boot_ms
        for n, frame in enumerate(sent)
        for data in (frame, *sent[n - 150 : n - 149][: n >= 150])  # each once more 1.5 s later
        for message in codec.decode(data, n * 10 * MS)
    ]
    assert read == [n * 10 for n in range(400)]
    assert (codec.lost, codec.repeated.copies) == (0, 250)
