"""Attachments, against the bytes of Zenoh's own serialiser, which rmw_zenoh uses."""

from __future__ import annotations

from zenoh.ext import Int64, z_serialize

from companion.flight.rmw.attachment import Attachment, unpack

GID = bytes(range(16))


def test_bytes_are_those_of_zenoh_s_serialiser() -> None:
    made = Attachment(5, 1_750_000_000_123_456_789, GID)
    assert made.pack() == bytes(z_serialize((Int64(5), Int64(1_750_000_000_123_456_789), GID)))
    assert unpack(made.pack()) == made


def test_anything_else_is_no_attachment() -> None:
    packed = Attachment(5, 7, GID).pack()
    for length in range(len(packed)):
        assert unpack(packed[:length]) is None
    assert unpack(packed + b"\0") is None
    assert unpack(packed[:16] + b"\x0f" + packed[17:]) is None
