"""MAVLink 2 signing of the simulated autopilot, using pymavlink's implementation."""

from __future__ import annotations

import hashlib
import stat
import time
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

EPOCH_S = 1_420_070_400
UNSIGNED = (mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_RADIO)


def read_key(path: Path) -> bytes:
    """Return the 32-byte key in a file: raw, as 64 hex digits, or the SHA-256 of a passphrase.

    Raises
    ------
    ValueError
        The file cannot be read, is empty, or is accessible to others than its owner.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise ValueError(f"--mavlink-key {path}: it is not a file")
        if mode & 0o077:
            raise ValueError(
                f"--mavlink-key {path}: others may use it; make it yours with 'chmod 600 {path}'"
            )
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(f"--mavlink-key {path}: it cannot be read ({error.strerror})") from None
    text = data.rstrip(b"\r\n")
    if not text:
        raise ValueError(f"--mavlink-key {path}: it is empty")
    try:
        return bytes.fromhex(text.decode("ascii") if len(text) == 64 else "-")
    except ValueError:
        raw = len(data) == 32 and not all(32 <= byte < 127 for byte in data)
        return data if raw else hashlib.sha256(text).digest()


def sign(codec: Any, key: bytes, link: int) -> None:
    """Make a codec sign its messages and refuse unsigned ones, except a radio's reports."""
    codec.signing.secret_key = key
    codec.signing.sign_outgoing = True
    codec.signing.link_id = link % 256
    codec.signing.allow_unsigned_callback = lambda _codec, number: number in UNSIGNED
    keep_time(codec)


def keep_time(codec: Any) -> None:
    """Advance the timestamp to the date, like an autopilot with GPS; it never goes back."""
    now = int((time.time() - EPOCH_S) * 1e5)
    codec.signing.timestamp = max(codec.signing.timestamp, now)
