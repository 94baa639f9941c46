"""Signed links of the simulator: only signed frames pass."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.wire.message_signing import read_key, sign
from sitl.wire.wire import MemoryWire, Router

KEY = bytes(range(32))
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def end(key: bytes | None) -> Any:
    codec = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    codec.robust_parsing = True
    if key is not None:
        sign(codec, key, 7)
    return codec


@pytest.mark.parametrize(("key", "delivered"), [(KEY, 1), (b"x" * 32, 0), (None, 0)])
def test_only_signed_frames_are_delivered_and_the_others_are_counted(
    key: bytes | None, delivered: int
) -> None:
    wire, got = MemoryWire(), []
    router = Router([wire], np.random.default_rng(1), lambda m, _: got.append(m), KEY)
    wire.send(bytes(HEARTBEAT.pack(end(key))))
    router.read(1)
    assert len(got) == delivered
    assert wire.peers[0].bad == 1 - delivered


def test_what_it_sends_is_signed_and_what_it_passes_on_keeps_its_signature() -> None:
    wires = [MemoryWire(), MemoryWire()]
    router = Router(wires, np.random.default_rng(1), lambda m, _: None, KEY)
    station, companion = end(KEY), end(KEY)
    wires[0].send(bytes(HEARTBEAT.pack(station)))
    router.read(1)
    router.send(None, HEARTBEAT)
    heard = companion.parse_buffer(bytearray(b"".join(wires[1].received)))
    assert [m.get_signed() for m in heard] == [True, True]
    assert [m.get_srcSystem() for m in heard] == [255, 1]


@pytest.mark.parametrize(
    ("data", "secret"),
    [(KEY, KEY), (KEY.hex().encode() + b"\n", KEY), (b"word\n", hashlib.sha256(b"word").digest())],
)
def test_keys_are_read_in_three_forms(tmp_path: Path, data: bytes, secret: bytes) -> None:
    path = tmp_path / "key"
    path.write_bytes(data)
    path.chmod(0o600)
    assert read_key(path) == secret
    path.chmod(0o644)
    with pytest.raises(ValueError, match="others may use it"):
        read_key(path)
    with pytest.raises(ValueError, match="cannot be read"):
        read_key(tmp_path / "none")
