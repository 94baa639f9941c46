"""Array file with atomic creation and memory-mapped reading."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ALIGNED = 64  # bytes
LENGTH = 8  # bytes of the number before the JSON directory: its size


def write(path: Path, arrays: Mapping[str, NDArray[Any]], notes: Mapping[str, Any] | None = None) -> None:
    """Write arrays and notes (JSON) to a file that appears under its name only when it is complete."""
    directory: dict[str, Any] = {"notes": dict(notes or {}), "arrays": {}}
    at = 0
    for name, values in arrays.items():
        directory["arrays"][name] = [values.dtype.str, list(values.shape), at]
        at += -(-values.nbytes // ALIGNED) * ALIGNED
    head = json.dumps(directory).encode()
    head += b" " * (-(len(head) + LENGTH) % ALIGNED)
    with atomic_file(path) as unfinished, unfinished.path.open("wb") as file:
        file.write(len(head).to_bytes(LENGTH, "little") + head)
        for values in arrays.values():
            file.write(np.ascontiguousarray(values).data)
            file.write(b"\0" * (-values.nbytes % ALIGNED))


def read(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return a file's arrays, memory-mapped, and its notes.

    The mapping is copy-on-write, so changes stay in memory: the kernels accept no read-only arrays.
    """
    with path.open("rb") as file:
        length = int.from_bytes(file.read(LENGTH), "little")
        directory = json.loads(file.read(length))
    data = np.memmap(path, np.uint8, "c") if path.stat().st_size > LENGTH + length else np.empty(0, np.uint8)
    found = {}
    for name, (kind, shape, at) in directory["arrays"].items():
        first = LENGTH + length + at
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        found[name] = np.asarray(data[first : first + size]).view(kind).reshape(shape)
    return found, directory["notes"]


class atomic_file:  # noqa: N801 - a context manager used as a function
    """Context manager of a temporary name: renamed to the final name on success, removed on error.

    Each name is unique, so two processes may write the same file at once.
    """

    def __init__(self, path: Path) -> None:
        self._final = path
        self.path = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}")

    def __enter__(self) -> atomic_file:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            os.replace(self.path, self._final)
        else:
            self.path.unlink(missing_ok=True)
