"""MCAP writer in a separate thread, so that nothing waits for the disk."""

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
from typing import TYPE_CHECKING, Any

from companion.flight.recorder.plain_mcap import PlainMcap
from companion.runtime.errors import UsageError

if TYPE_CHECKING:
    import foxglove

log = logging.getLogger(__name__)

CHUNK_BYTES = 1 << 20
MOST_WAITING_BYTES = 64 << 20
LEAST_FREE_BYTES = 512 << 20
BEGIN_BYTES = 16 << 20  # the library crashes the program if it cannot write the first bytes of a file
FLUSH_S = 1.0
TOGETHER_S = 0.05  # batching interval, because waking for every entry would delay the producers
CLOSE_S = 10.0
MIB = 1 << 20


@dataclass(frozen=True, slots=True)
class Entry:
    """A message: topic, log time, data or a function that makes them, and size."""

    topic: str
    log_time_ns: int
    data: bytes | Callable[[], Any]
    size: int


class McapWriter:
    """An MCAP file in chunks, readable up to the last second however the program ends.

    Entries wait in a queue of bounded size; when it is full, new ones are dropped and counted.

    Parameters
    ----------
    path
        File to create; an existing file is never overwritten.
    channels
        Creates the channels in a Foxglove context: topic to an object with `log(message, log_time=)`. None
        writes without Foxglove's library, only the topics of `plain_mcap.CHANNELS`.
    most_bytes
        Greatest file size; writing also ends when less than `least_free_bytes` are free on the disk.

    Raises
    ------
    UsageError
        The file exists or cannot be created.
    """

    def __init__(
        self,
        path: Path,
        channels: Callable[[foxglove.Context], Mapping[str, Any]] | None,
        most_bytes: int,
        metadata: dict[str, str],
        least_free_bytes: int = LEAST_FREE_BYTES,
    ) -> None:
        if path.exists():
            raise UsageError(f"--record {path}: there is one already; name another file")
        if path.parent.is_dir() and shutil.disk_usage(path.parent).free < BEGIN_BYTES:
            raise UsageError(f"--record {path}: less than {BEGIN_BYTES // MIB} MiB are free there: make room")
        try:
            self._writer, self._channels, self._context = _open(path, channels)
            self._writer.write_metadata("slz", metadata)
            self._file = os.open(path, os.O_RDONLY)
        except Exception as error:
            raise UsageError(f"--record {path}: {error}") from None
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
        """Reason why writing ended; empty until then."""
        self._thread = threading.Thread(target=self._run, name="slz-recorder", daemon=True)
        self._thread.start()

    def put(self, entry: Entry) -> bool:
        """Queue an entry; return whether it was accepted. Never blocks."""
        if self.ended or self._waiting + entry.size > MOST_WAITING_BYTES:
            self.dropped[entry.topic] += 1
            return False
        with self._lock:
            self._queue.append(entry)
            self._waiting += entry.size
        return True

    def close(self) -> None:
        """Write queued entries and close the file; abandon a hanging disk, which leaves the file readable."""
        self._closing.set()
        self._thread.join(CLOSE_S)
        if self._thread.is_alive():
            self._end("the disk does not answer")

    @property
    def size_bytes(self) -> int:
        """Length of the file now, even if it was renamed or deleted."""
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
        """Write for a second; return whether to go on."""
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
        except Exception:  # one lost display message does not end a recording
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


def _open(
    path: Path, channels: Callable[[foxglove.Context], Mapping[str, Any]] | None
) -> tuple[Any, Mapping[str, Any], Any]:
    """Return the open file, its channels by topic, and the context with which the channels close."""
    if channels is None:
        plain = PlainMcap(path, CHUNK_BYTES)
        return plain, plain.channels(), None
    import foxglove
    from foxglove.mcap import MCAPCompression, MCAPWriteOptions

    context = foxglove.Context()
    options = MCAPWriteOptions(compression=MCAPCompression.Lz4, chunk_size=CHUNK_BYTES, compression_threads=0)
    writer = foxglove.open_mcap(path, context=context, writer_options=options)
    return writer, channels(context), context
