"""Probe inside the processes of one flight: every datagram sent, and every report of the pipeline.

Python imports a module of this name at its start when the folder is on PYTHONPATH. It changes nothing that
the program sees, and uses of it only `slz.Pipeline.process`, which is part of its public interface.
"""

from __future__ import annotations

import atexit
import importlib.abc
import importlib.util
import os
import pickle
import socket
import struct
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

OUTPUT = "SLZ_PROBE"
DATAGRAM = struct.Struct("<HI")  # port, size


def _numbered(folder: Path, ending: str) -> Path:
    """Return a file of this process: processes are numbered in the order of their start."""
    number = 0
    while True:
        path = folder / f"{number}{ending}"
        try:
            path.touch(exist_ok=False)
        except FileExistsError:
            number += 1
        else:
            return path


def tap_datagrams(folder: Path) -> None:
    """Write port, size and bytes of every datagram that a socket of this process sends."""
    file = _numbered(folder, ".datagrams").open("wb")
    plain = socket.socket.sendto

    def sendto(self: socket.socket, data: Any, *rest: Any) -> int:
        sent = plain(self, data, *rest)
        address = rest[-1]
        if self.family == socket.AF_INET and self.type == socket.SOCK_DGRAM:
            file.write(DATAGRAM.pack(address[1], len(data)) + bytes(data))
        return sent

    socket.socket.sendto = sendto  # type: ignore[method-assign,assignment]
    atexit.register(file.close)


class _AfterImport(importlib.abc.MetaPathFinder):
    """Has `slz.Pipeline` watched as soon as `slz` has been imported."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def find_spec(self, name: str, path: Any, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != "slz":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            execute, folder = spec.loader.exec_module, self._folder

            def exec_module(module: ModuleType) -> None:
                execute(module)
                watch_reports(module, folder)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def watch_reports(module: ModuleType, folder: Path) -> None:
    """Write a plain copy of every report that `Pipeline.process` returns."""
    from tests.answers.reports import plain

    file = _numbered(folder, ".reports").open("wb")
    process = module.Pipeline.process

    def watched(self: Any, *args: Any, **named: Any) -> Any:
        report = process(self, *args, **named)
        pickle.dump(plain(report), file)
        return report

    module.Pipeline.process = watched
    atexit.register(file.close)


if OUTPUT in os.environ:
    tap_datagrams(Path(os.environ[OUTPUT]))
    sys.meta_path.insert(0, _AfterImport(Path(os.environ[OUTPUT])))
