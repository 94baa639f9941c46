"""Instructions of a recorded flight, counted from outside, and digests of its maps to compare processors.

    python -m tests.bench.instructions flight.mcap [--every 10] [--until 60]

After every tenth window the process calls getpriority(2) with an impossible argument, which whoever counts
instructions sees: `tests/bench/instruction_counter.c` under qemu-user, or callgrind with
`--dump-before=getpriority`. Prints JSON: the time of each mark, how many reports are equal to the flight's to
the last bit, and digests of the maps.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import platform
import time
from pathlib import Path
from typing import Any

from companion.desk.replay.own_replay import Replay
from companion.desk.replay.recording_reader import RecordingReader
from companion.runtime.process_tuning import keep_memory
from slz.warm_up import warm_up

MARK = 77  # no class of priorities
NS = 1e-9


def mark(number: int) -> None:
    """Make the system call that a counter waits for; it fails."""
    with contextlib.suppress(OSError, ValueError):
        os.getpriority(MARK, number)


def replayed(path: Path, every: int, until: int) -> dict[str, Any]:
    """Return what came of the first `until` windows of a recording."""
    recording = RecordingReader(path)
    parameters = recording.header.parameters(())
    replay = Replay(recording.header, parameters)
    warm_up(parameters)
    marks, windows, begun_ns = [], 0, None
    for message in recording.messages():
        begun_ns = message.at_ns if begun_ns is None else begun_ns
        if replay.process_message(message) is None:
            continue
        windows += 1
        if windows % every == 0:
            mark(windows)
            marks.append([windows, (message.at_ns - begun_ns) * NS, time.process_time()])
        if windows == until:
            break
    maps = replay.maps()
    layers = {} if maps is None else {"state": maps.state, **maps.layers}
    return {
        "machine": platform.machine(),
        "windows": windows,
        "same": replay.outcome.same,
        "other": replay.outcome.other,
        "marks (window, s of flight, s of processor time)": marks,
        "digests": {name: hashlib.sha256(values.tobytes()).hexdigest() for name, values in layers.items()},
    }


def main() -> None:
    """Replay as the arguments say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--every", type=int, default=10, help="windows from one mark to the next")
    parser.add_argument("--until", type=int, default=10**9, help="last window")
    options = parser.parse_args()
    keep_memory()
    print(json.dumps(replayed(options.recording, options.every, options.until), indent=1))


if __name__ == "__main__":
    main()
