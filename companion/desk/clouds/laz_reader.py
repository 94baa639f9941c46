"""LAZ reader in a child process.

Some corrupt files make the decompressor exhaust its stack or memory, which ends its process; the child
protects this one. One child serves file after file.
"""

from __future__ import annotations

import atexit
import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, cast

import laspy
import numpy as np

from companion.desk.clouds.cloud_source import CHUNK, corrupt, reason_of

ROOT = Path(__file__).parents[3]
HEAD = struct.Struct("<cQ")  # kind of message, and its length in bytes
POINTS, FAILED, DONE = b"P", b"F", b"D"


class _Reader:
    """Handle of the child process; idle: no answer is pending."""

    def __init__(self) -> None:
        self.idle = True
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=ROOT,
            start_new_session=True,  # keeps Ctrl-C from the child
        )

    def read(self, path: Path) -> Iterator[bytearray]:
        """Yield the points of a file in chunks of uncompressed LAS records."""
        questions, answers = cast(IO[bytes], self._process.stdin), cast(Any, self._process.stdout)
        self.idle = False
        questions.write(os.fsencode(path.absolute()) + b"\0")
        questions.flush()
        while True:
            head = answers.read(HEAD.size)
            kind, size = HEAD.unpack(head) if len(head) == HEAD.size else (FAILED, -1)
            data = bytearray(max(0, size))
            if answers.readinto(data) != size:
                raise corrupt(path, f"its reader ended with code {self._process.wait()}")
            self.idle = kind != POINTS
            if kind == DONE:
                return
            if kind == FAILED:
                raise corrupt(path, data.decode(errors="replace"))
            yield data

    @property
    def lives(self) -> bool:
        """True while the process runs: it may have been killed while idle."""
        return self._process.poll() is None

    def close(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.communicate()


_idle: list[_Reader] = []


def read_points(path: Path, header: Any) -> Iterator[Any]:
    """Yield the points of a LAZ file with all dimensions, a million at a time, as laspy records.

    Raises
    ------
    UsageError
        The file is truncated or corrupt.
    """
    reader = _ready()
    try:
        for data in reader.read(path):
            points = np.frombuffer(data, header.point_format.dtype())
            yield laspy.ScaleAwarePointRecord(points, header.point_format, header.scales, header.offsets)
    finally:
        if reader.idle:
            _idle.append(reader)
        else:  # the answer is unfinished, or the process ended
            reader.close()


def _ready() -> _Reader:
    while _idle:
        reader = _idle.pop()
        if reader.lives:
            return reader
        reader.close()
    return _Reader()


@atexit.register
def _close() -> None:
    while _idle:
        _idle.pop().close()


def serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    """Read the requested files until the pipe closes."""
    asked = b""
    while some := questions.read1(4096):  # type: ignore[attr-defined]
        asked += some
        while b"\0" in asked:
            path, _, asked = asked.partition(b"\0")
            try:
                with laspy.open(Path(os.fsdecode(path)), encoding_errors="replace") as reader:
                    for piece in reader.chunk_iterator(CHUNK):
                        _answer(answers, POINTS, np.ascontiguousarray(piece.array).view(np.uint8).data)
            except BrokenPipeError:  # the parent is gone
                raise
            except BaseException as error:  # Rust's panics do not derive from Exception
                _answer(answers, FAILED, reason_of(error).encode())
            else:
                _answer(answers, DONE, b"")


def _answer(answers: IO[bytes], kind: bytes, data: bytes | memoryview) -> None:
    answers.write(HEAD.pack(kind, len(data)))
    answers.write(data)
    answers.flush()


if __name__ == "__main__":
    serve(sys.stdin.buffer, sys.stdout.buffer)
