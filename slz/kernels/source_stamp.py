"""Source stamp of a compiled kernel: a hash of its module and of every product module that it imports."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

IMPORTED = re.compile(rb"^from ((?:slz|companion)(?:\.\w+)+) import", re.MULTILINE)


def sources_of(path: Path, root: Path) -> dict[Path, bytes]:
    """Return the sources of a module and of all product modules that it imports, transitively.

    Parameters
    ----------
    path
        The module; may be anywhere.
    root
        Folder of the packages `slz` and `companion`.
    """
    found: dict[Path, bytes] = {}
    waiting = [path]
    while waiting:
        source = waiting.pop()
        if source not in found and (source == path or source.is_file()):
            found[source] = source.read_bytes()
            names = (name.decode().split(".") for name in IMPORTED.findall(found[source]))
            waiting += [root.joinpath(*name).with_suffix(".py") for name in names]
    return found


def stamp(path: Path, root: Path) -> bytes:
    """Return a hash of all sources that the kernels of a module are compiled from."""
    whole = hashlib.sha256()
    texts = sorted((source.name, text) for source, text in sources_of(path, root).items())
    for name, text in texts:  # names only, so that the hash does not depend on the installation folder
        whole.update(f"{name} {len(text)}\n".encode() + text)
    return whole.digest()
