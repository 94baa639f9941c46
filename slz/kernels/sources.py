"""What a compiled kernel is made of: its own source and those of the kernels that it calls."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

IMPORTED = re.compile(rb"^from slz\.kernels\.(\w+) import", re.MULTILINE)


def sources_of(path: Path, kernels: Path) -> dict[Path, bytes]:
    """Return the source of a module and of all that it imports from a folder of kernels, however far down."""
    found: dict[Path, bytes] = {}
    waiting = [path]
    while waiting:
        source = waiting.pop()
        if source not in found and (source == path or source.is_file()):
            found[source] = source.read_bytes()
            waiting += [kernels / f"{name.decode()}.py" for name in IMPORTED.findall(found[source])]
    return found


def stamp(path: Path, kernels: Path) -> bytes:
    """Return what changes when anything does that the kernels of a module are compiled from."""
    whole = hashlib.sha256()
    texts = sorted((source.name, text) for source, text in sources_of(path, kernels).items())
    for name, text in texts:  # wherever they lie
        whole.update(f"{name} {len(text)}\n".encode() + text)
    return whole.digest()
