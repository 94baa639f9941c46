"""Damaged parts of a capture: account of omitted bytes, and search for the next whole record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

STRETCH = 1 << 20  # bytes searched at once

Finder = Callable[[NDArray[np.uint32]], NDArray[np.bool_]]


@dataclass(slots=True)
class DamagedParts:
    """Account of the parts of a file that cannot be read.

    parts: first byte and the byte after the last of each. why: fault of the first one.
    """

    parts: list[tuple[int, int]] = field(default_factory=list)
    why: str = ""

    def add(self, begin: int, end: int, why: str) -> None:
        """Add a part behind those before."""
        self.why = self.why or why
        if self.parts and self.parts[-1][1] >= begin:
            begin, _ = self.parts.pop()
        self.parts.append((begin, end))

    def sentence(self, size: int) -> str:
        """Return the sentence on the lost parts of a file of `size` bytes, empty without such parts."""
        if not self.parts:
            return ""
        begin = self.parts[0][0]
        if len(self.parts) == 1 and self.parts[0][1] >= size:
            return f"{self.why}: its last {size - begin} bytes are left out"
        n_bytes = sum(end - begin for begin, end in self.parts)
        places = "one place" if len(self.parts) == 1 else f"{len(self.parts)} places"
        return (
            f"{self.why}: it is damaged in {places}, the first at byte {begin}, and {n_bytes} of its"
            f" {size} bytes are left out"
        )


def next_record(
    file: BinaryIO, begin: int, n_words: int, order: str, looks: Finder, is_whole: Callable[[int], bool]
) -> int | None:
    """Return the offset of the first whole record at or after `begin`, None if there is none.

    Parameters
    ----------
    n_words
        Number of 32-bit words that `looks` examines.
    order
        Byte order of the words, < or >.
    looks
        Maps the words at n offsets, (n, n_words), to (n,) bool: those that may begin a record.
    is_whole
        Returns whether a record at this offset is whole; it may move the file's position.
    """
    margin = 4 * n_words - 1
    while True:
        file.seek(begin)
        data = np.frombuffer(file.read(STRETCH + margin), np.uint8)
        n = len(data) - margin
        if n <= 0:
            return None
        bytes_ = np.lib.stride_tricks.sliding_window_view(data, 4 * n_words)
        words = np.ascontiguousarray(bytes_).view(order + "u4")
        for k in np.flatnonzero(looks(words)):
            if is_whole(begin + int(k)):
                return begin + int(k)
        begin += n
