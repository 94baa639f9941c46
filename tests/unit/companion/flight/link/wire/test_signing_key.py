"""Keys in every form, and files that are refused in one line."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from companion.flight.link.wire.key_mismatch import KeyMismatch
from companion.flight.link.wire.signing import Verdict
from companion.flight.link.wire.signing_key import read_key
from companion.runtime.errors import UsageError

RAW = bytes(range(32))


def written(folder: Path, data: bytes, mode: int = 0o600) -> Path:
    path = folder / "key"
    path.write_bytes(data)
    path.chmod(mode)
    return path


@pytest.mark.parametrize(
    ("data", "secret", "form"),
    [
        (RAW, RAW, "32 bytes"),
        (b"\n" * 32, b"\n" * 32, "32 bytes"),
        (RAW.hex().encode(), RAW, "64 hex digits"),
        (RAW.hex().upper().encode() + b"\r\n", RAW, "64 hex digits"),
        (b"correct horse\n", hashlib.sha256(b"correct horse").digest(), "a passphrase (SHA-256)"),
        (b"p" * 32, hashlib.sha256(b"p" * 32).digest(), "a passphrase (SHA-256)"),
        ("Schlüssel".encode(), hashlib.sha256("Schlüssel".encode()).digest(), "a passphrase (SHA-256)"),
    ],
)
def test_every_form_is_read(tmp_path: Path, data: bytes, secret: bytes, form: str) -> None:
    key = read_key(written(tmp_path, data))
    assert (key.secret, key.form) == (secret, form)
    assert secret.hex() not in repr(key)
    assert repr(secret) not in repr(key)


@pytest.mark.parametrize("mode", [0o400, 0o600, 0o700])
def test_the_owner_alone_may_use_it(tmp_path: Path, mode: int) -> None:
    assert read_key(written(tmp_path, RAW, mode)).secret == RAW


@pytest.mark.parametrize(
    ("data", "mode", "fault"),
    [
        (RAW, 0o640, "others may use it (mode 640)"),
        (RAW, 0o604, "chmod 600"),
        (b"", 0o600, "it is empty"),
        (b"\n", 0o600, "it is empty"),
        (b"\xff\xfe\xfd", 0o600, "neither 32 bytes, nor 64 hex digits"),
        (b"a" * 2000, 0o600, "longer than 1024 bytes"),
    ],
)
def test_a_fault_is_one_line_that_does_not_hold_the_key(
    tmp_path: Path, data: bytes, mode: int, fault: str
) -> None:
    with pytest.raises(UsageError) as caught:
        read_key(written(tmp_path, data, mode))
    line = str(caught.value)
    assert fault in line
    assert "--mavlink-key" in line
    assert "\n" not in line


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe", 0o600)
    for name, fault in (("none", "No such file"), ("pipe", "not a file"), (".", "not a file")):
        with pytest.raises(UsageError, match=fault):
            read_key(tmp_path / name)


# Keys of MAVLink signing that do not match: each case has a short text and a remedy.


@pytest.mark.parametrize("mismatch", KeyMismatch)
def test_each_fits_one_text_of_the_pilot_and_has_a_remedy(mismatch: KeyMismatch) -> None:
    assert len(f"SLZ: {mismatch.value}: mapping only") <= 50
    assert len(mismatch.remedy) > 30


@pytest.mark.parametrize(
    ("verdict", "mismatch"),
    [
        (None, None),
        ("good", None),
        ("allowed", None),
        ("unsigned", KeyMismatch.NOT_SIGNED),
        ("forged", KeyMismatch.OTHER_KEY),
        ("replayed", KeyMismatch.OLD_TIMES),
    ],
)
def test_a_refused_frame_of_the_autopilot_shows_how_the_keys_differ(
    verdict: Verdict | None, mismatch: KeyMismatch | None
) -> None:
    assert KeyMismatch.of(verdict) is mismatch
