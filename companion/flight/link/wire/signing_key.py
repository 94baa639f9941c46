"""Key of MAVLink 2 signing, from a file that only its owner can read."""

from __future__ import annotations

import hashlib
import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NoReturn

from companion.runtime.errors import UsageError

KEY_BYTES = 32
LONGEST_BYTES = 1024
OTHERS = 0o077
_HEX = re.compile(rb"[0-9a-fA-F]{64}")

Form = Literal["32 bytes", "64 hex digits", "a passphrase (SHA-256)"]


@dataclass(frozen=True, slots=True, repr=False)
class Key:
    """Secret of 32 bytes and its form in the file; never shown in a log."""

    secret: bytes
    form: Form


def read_key(path: Path) -> Key:
    """Return the key in a file.

    64 hex digits are the key; 32 bytes, at least one of them not printable ASCII, are the key; anything else
    is a passphrase in UTF-8, whose SHA-256 is the key, as in MAVProxy and Mission Planner. Line ends after
    digits and passphrases are ignored.

    Raises
    ------
    UsageError
        The file cannot be read, is not a regular file, is empty or too long, or is accessible to others.
    """
    data = _read(path)
    text = data.rstrip(b"\r\n")
    if _HEX.fullmatch(text):
        return Key(bytes.fromhex(text.decode("ascii")), "64 hex digits")
    if len(data) == KEY_BYTES and not all(32 <= byte < 127 for byte in data):
        return Key(data, "32 bytes")
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        _refuse(path, "it holds neither 32 bytes, nor 64 hex digits, nor a passphrase in UTF-8")
    if not text:
        _refuse(path, "it is empty")
    return Key(hashlib.sha256(text).digest(), "a passphrase (SHA-256)")


def _read(path: Path) -> bytes:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        _refuse(path, f"it cannot be read ({getattr(error, 'strerror', None) or error})")
    try:
        mode = os.fstat(descriptor).st_mode  # of the opened file: the name may refer to another one by now
        if not stat.S_ISREG(mode):
            _refuse(path, "it is not a file")
        if mode & OTHERS:
            shown = f"{stat.S_IMODE(mode):o}"
            _refuse(path, f"others may use it (mode {shown}); make it yours alone with 'chmod 600 {path}'")
        data = os.read(descriptor, LONGEST_BYTES + 1)
    finally:
        os.close(descriptor)
    if len(data) > LONGEST_BYTES:
        _refuse(path, f"it is longer than {LONGEST_BYTES} bytes")
    return data


def _refuse(path: Path, fault: str) -> NoReturn:
    raise UsageError(f"--mavlink-key {path}: {fault}")
