"""Differences between two trees, each with its key path."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.answers import mavlink_frames
from tests.answers.tree import Tree, array_digest, packed

LONGEST = 60
INDEX = re.compile(r"\[\d+(?:, \d+)*\]")


@dataclass(frozen=True)
class Difference:
    """One difference: the key path, and what is different there."""

    path: str
    what: str

    @property
    def kind(self) -> str:
        """Path without indices: differences of one kind are told in one line."""
        return INDEX.sub("[*]", self.path)


def differences(before: Tree, after: Tree, path: str = "") -> Iterator[Difference]:
    """Yield each key that was added, is missing or holds another value, in the order of the first tree."""
    if isinstance(before, dict) and isinstance(after, dict):
        if mavlink_frames.is_stream(before) and mavlink_frames.is_stream(after):
            yield from _streams(before, after, path)
        else:
            yield from _dicts(before, after, path)
    elif isinstance(before, list) and isinstance(after, list):
        yield from _lists(before, after, path)
    elif isinstance(before, np.ndarray) and isinstance(after, np.ndarray):
        yield from _arrays(before, after, path)
    elif packed(before, []) != packed(after, []) or type(before) is not type(after):
        yield Difference(path or "(all)", f"{_shown(before)} before, {_shown(after)} after")


def grouped(found: Iterator[Difference]) -> Iterator[str]:
    """Yield one line for each kind of difference: the first, and how many more there are."""
    kinds: dict[str, list[Difference]] = {}
    counts: dict[str, int] = {}
    for one in found:
        counts[one.kind] = counts.get(one.kind, 0) + 1
        kinds.setdefault(one.kind, [one])
    for kind, (first,) in kinds.items():
        more = counts[kind] - 1
        yield f"{first.path}: {first.what}" + (f" (and {more} more at {kind})" if more else "")


def _dicts(before: dict[str, Tree], after: dict[str, Tree], path: str) -> Iterator[Difference]:
    for key, value in before.items():
        inner = f"{path}.{key}" if path else key
        if key in after:
            yield from differences(value, after[key], inner)
        else:
            yield Difference(inner, f"missing after, was {_shown(value)}")
    for key, value in after.items():
        if key not in before:
            yield Difference(f"{path}.{key}" if path else key, f"added: {_shown(value)}")


def _lists(before: list[Tree], after: list[Tree], path: str) -> Iterator[Difference]:
    if len(before) != len(after):
        yield Difference(f"{path}.length", f"{len(before)} before, {len(after)} after")
    for k, (one, other) in enumerate(zip(before, after, strict=False)):
        yield from differences(one, other, f"{path}[{k}]")


def _arrays(before: NDArray[Any], after: NDArray[Any], path: str) -> Iterator[Difference]:
    if before.dtype != after.dtype:
        yield Difference(f"{path}.dtype", f"{before.dtype} before, {after.dtype} after")
    elif before.shape != after.shape:
        yield Difference(f"{path}.shape", f"{before.shape} before, {after.shape} after")
    elif array_digest(before) != array_digest(after):
        other = _unequal_bits(before, after)
        first = np.unravel_index(int(np.argmax(other)), before.shape)
        place = ", ".join(str(int(k)) for k in first)
        values = f"{before[first]!r} before, {after[first]!r} after"
        yield Difference(f"{path}[{place}]", f"{values}; {int(other.sum())} of {other.size} elements differ")


def _unequal_bits(before: NDArray[Any], after: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where two arrays of one dtype and shape differ in any bit."""
    size = before.dtype.itemsize
    raw = [np.ascontiguousarray(a).reshape(-1).view(np.uint8).reshape(-1, size) for a in (before, after)]
    unequal: NDArray[np.bool_] = (raw[0] != raw[1]).any(axis=1)
    return unequal.reshape(before.shape)


def _streams(before: dict[str, Tree], after: dict[str, Tree], path: str) -> Iterator[Difference]:
    """Yield the fields of datagrams that differ; of streams of unequal length only the first datagram's."""
    one, other = mavlink_frames.datagrams(before), mavlink_frames.datagrams(after)
    for k, (mine, yours) in enumerate(zip(one, other, strict=False)):
        if mine != yours:
            inner = f"{path}[{k}]"
            found = list(_dicts(mavlink_frames.decoded(mine), mavlink_frames.decoded(yours), inner))
            bits = Difference(inner, f"{mine.hex()} before, {yours.hex()} after")
            yield from found or [bits]
            if len(one) != len(other):
                break
    if len(one) != len(other):
        yield Difference(f"{path}.length", f"{len(one)} datagrams before, {len(other)} after")


def _shown(value: Tree) -> str:
    if isinstance(value, np.ndarray):
        return f"array {value.dtype} {value.shape}"
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
