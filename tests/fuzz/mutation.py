"""Mutation of inputs as by transmission, storage and attackers."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from random import Random

MOST_BYTES = 1 << 16
NUMBERS = tuple(
    struct.pack(order + form, value)
    for order in "<>"
    for form, values in (
        ("H", (0, 1, 0x7FFF, 0x8000, 0xFFFF)),
        ("I", (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)),
        ("Q", (0, 2**62, 2**63 - 1, 2**63, 2**64 - 1)),
        ("f", (float("nan"), float("inf"), -0.0, 3e38, 1e-40)),
        ("d", (float("nan"), float("-inf"), 1e308, 5e-324)),
    )
    for value in values
)
DIGITS = (
    b"0",
    b"-1",
    b"1e999",
    b"nan",
    b"4294967296",
    b"9" * 30,
    b"9" * 5000,
    "²".encode(),
    b"\xff",
    b"\0",
    b"[" * 3000,
)


def mutated(data: bytes, others: Sequence[bytes], words: Sequence[bytes], rng: Random) -> bytes:
    """Return the input with one to five changes."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5))):
        _change(out, others, words, rng)
        if len(out) > MOST_BYTES:
            del out[MOST_BYTES:]
    return bytes(out)


def _change(out: bytearray, others: Sequence[bytes], words: Sequence[bytes], rng: Random) -> None:
    kind = rng.randrange(9)
    at = rng.randrange(len(out) + 1)
    if kind == 0 and out:
        out[at % len(out)] ^= 1 << rng.randrange(8)
    elif kind == 1 and out:
        out[at % len(out)] = rng.randrange(256)
    elif kind == 2:
        number = rng.choice(NUMBERS)
        out[at : at + len(number)] = number
    elif kind == 3:
        del out[at:]
    elif kind == 4:
        del out[at : at + rng.randrange(1, 64)]
    elif kind == 5:
        out[at:at] = rng.randbytes(rng.randrange(1, 32))
    elif kind == 6:
        part = out[at : at + rng.randrange(1, 256)]
        out[at:at] = part * rng.choice((1, 1, 2, 16))
    elif kind == 7 and others:
        other = rng.choice(others)
        begin = rng.randrange(len(other) + 1)
        out[at : at + rng.randrange(0, 64)] = other[begin : begin + rng.randrange(1, 512)]
    else:
        word = rng.choice((*words, *DIGITS))
        out[at : at + (len(word) if rng.random() < 0.5 else 0)] = word
