"""Fuzz harness of a parser: source of inputs, one trial, and the exceptions it may raise."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType

Target = Callable[[bytes], None]
"""Tries one input, after those before it; raises what nobody documented."""


def as_it_is(data: bytes, _rng: Random) -> bytes:
    """Mend nothing."""
    return data


@dataclass(frozen=True, slots=True)
class Harness:
    """One parser.

    Attributes
    ----------
    corpus
        Real inputs to begin from.
    make
        Returns a target with a state of its own; the folder is for files.
    mend
        Makes checksums right again, so that more than the checksum is tried.
    words
        Pieces that the format gives a meaning.
    renew
        Inputs that a target takes before a new one begins.
    limit_s
        Processor time that one input may take.
    cost
        How dear an input is: runs of all harnesses share their inputs by it.
    """

    name: str
    corpus: Callable[[], Sequence[bytes]]
    make: Callable[[Path], Target]
    mend: Callable[[bytes, Random], bytes] = as_it_is
    words: tuple[bytes, ...] = ()
    renew: int = 64
    limit_s: float = 2.0
    cost: float = 1.0


class HangError(RuntimeError):
    """An input takes longer than its limit."""


@contextmanager
def limited(limit_s: float) -> Iterator[None]:
    """Interrupt what uses more processor time, for a paused process is no hang; main thread only.

    Raises
    ------
    HangError
        It was interrupted, or took too long and hid that.
    """

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise HangError(f"longer than {limit_s:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    start = time.process_time()
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
    if time.process_time() - start > limit_s:
        raise HangError(f"longer than {limit_s:g} s")
