"""Writes a recording in a thread of its own, and never makes anybody wait for the disk."""

from __future__ import annotations

import logging
import os
import shutil
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import foxglove
from foxglove.mcap import MCAPCompression, MCAPWriteOptions

from companion.runtime.errors import UsageError

log = logging.getLogger(__name__)

CHUNK_BYTES = 1 << 20
MOST_WAITING_BYTES = 64 << 20
LEAST_FREE_BYTES = 512 << 20
BEGIN_BYTES = 16 << 20  # a library that cannot write the first bytes of a file takes the program with it
FLUSH_S = 1.0
TOGETHER_S = 0.05  # a thread that woke for every entry would hold up those that hand them over
CLOSE_S = 10.0
MIB = 1 << 20


@dataclass(frozen=True, slots=True)
class Entry:
    """One message: its topic's channel, its data or what makes it, and when."""

    topic: str
    log_time_ns: int
    data: bytes | Callable[[], Any]
    size: int


class McapWriter:
    """An MCAP file in chunks, readable up to the last second whatever ends the program.

    Entries wait in a queue of bounded size; one that finds it full is dropped and counted.

    Parameters
    ----------
    path
        File to make; one that is there is never written over.
    channels
        Makes the channels in a Foxglove context: topic to an object with `log(message, log_time=)`.
    most_bytes
        The file grows no longer; nor while less than half a gibibyte is free on its disk.

    Raises
    ------
    UsageError
        The file is there or cannot be made.
    """

    def __init__(
        self,
        path: Path,
        channels: Callable[[foxglove.Context], Mapping[str, Any]],
        most_bytes: int,
        metadata: dict[str, str],
        least_free_bytes: int = LEAST_FREE_BYTES,
    ) -> None:
        if path.exists():
            raise UsageError(f"--record {path}: there is one already; name another file")
        if path.parent.is_dir() and shutil.disk_usage(path.parent).free < BEGIN_BYTES:
            raise UsageError(f"--record {path}: less than {BEGIN_BYTES // MIB} MiB are free there: make room")
        self._context = context = foxglove.Context()  # its channels close with it
        options = MCAPWriteOptions(
            compression=MCAPCompression.Lz4, chunk_size=CHUNK_BYTES, compression_threads=0
        )
        try:
            self._writer = foxglove.open_mcap(path, context=context, writer_options=options)
            self._writer.write_metadata("slz", metadata)
            self._file = os.open(path, os.O_RDONLY)
        except Exception as error:
            raise UsageError(f"--record {path}: {error}") from None
        self._channels = channels(context)
        self._path = path
        self._most_bytes = most_bytes
        self._least_free_bytes = least_free_bytes
        self._queue: deque[Entry] = deque()
        self._waiting = 0
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._closed = False
        self._size_bytes = 0
        self.dropped: Counter[str] = Counter()
        self.written: Counter[str] = Counter()
        self.flushes = 0
        self.ended = ""
        """Why nothing more is written; empty while it is."""
        self._thread = threading.Thread(target=self._run, name="slz-recorder", daemon=True)
        self._thread.start()

    def put(self, entry: Entry) -> bool:
        """Queue an entry; return whether it will be written. Never blocks."""
        if self.ended or self._waiting + entry.size > MOST_WAITING_BYTES:
            self.dropped[entry.topic] += 1
            return False
        with self._lock:
            self._queue.append(entry)
            self._waiting += entry.size
        return True

    def close(self) -> None:
        """Write what waits and end the file; a disk that hangs is left behind, the file whole up to it."""
        self._closing.set()
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            self._end("the disk does not answer")

    @property
    def size_bytes(self) -> int:
        """Length of the file now, whatever became of its name."""
        return self._size_bytes if self._closed else os.fstat(self._file).st_size

    # ---- the thread -----------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while self._write_some():
                self._writer.flush()
                os.fsync(self._file)
                self.flushes += 1
                self._stop_when_full()
        except Exception as error:
            self._end(f"writing failed: {error}")
        finally:
            try:
                self._writer.close()
            except Exception as error:
                self._end(f"closing failed: {error}")
            self._size_bytes = os.fstat(self._file).st_size
            self._closed = True
            os.close(self._file)

    def _write_some(self) -> bool:
        """Write for a second; return whether there is more to come."""
        until_s = time.monotonic() + FLUSH_S
        while (left_s := until_s - time.monotonic()) > 0:
            closing = self._closing.wait(min(left_s, TOGETHER_S))
            with self._lock:
                entries, self._queue, self._waiting = self._queue, deque(), 0
            for entry in entries:
                self._write(entry)
            if closing and not self._queue:
                return False
        return True

    def _write(self, entry: Entry) -> None:
        if self.ended:
            self.dropped[entry.topic] += 1
            return
        try:
            message = entry.data() if callable(entry.data) else entry.data
        except Exception:  # one picture less is no reason to end a recording
            if not self.dropped[entry.topic]:
                log.exception("a message on %s cannot be made", entry.topic)
            self.dropped[entry.topic] += 1
            return
        self._channels[entry.topic].log(message, log_time=entry.log_time_ns)
        self.written[entry.topic] += 1

    def _stop_when_full(self) -> None:
        disk = os.fstatvfs(self._file)
        if self.size_bytes > self._most_bytes:
            self._end(f"it has reached {self._most_bytes // MIB} MiB")
        elif disk.f_bavail * disk.f_frsize < self._least_free_bytes:
            self._end("the disk is nearly full")

    def _end(self, why: str) -> None:
        if not self.ended:
            self.ended = why
            log.warning("recording into %s ended: %s", self._path, why)
