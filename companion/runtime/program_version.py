"""Version of the program: release and digest of its source, stored with every result."""

from __future__ import annotations

import functools
import hashlib
from importlib import metadata
from pathlib import Path

PACKAGES = ("companion", "params", "sitl", "slz")
LEFT_OUT = ("__pycache__", "companion/desk/evidence")  # the safety case changes none of its inputs
DIGITS = 12


@functools.cache
def program_version() -> str:
    """Return release and digest, such as `1.0.0+1f3a9c02b7de`; the same source gives the same on any machine.

    The digest covers every file of the packages, the simulator's too: another world is another result. It is
    taken at the first call, so that a long run calls it before its first flight.
    """
    return f"{metadata.version('slz')}+{source_digest(Path(__file__).parents[2])}"


def source_digest(root: Path) -> str:
    """Return the first digits of the SHA-256 of the packages' files below a folder, with their names."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*")):
            name = path.relative_to(root).as_posix()
            if path.is_file() and not any(part in name for part in LEFT_OUT):
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                digest.update(f"{name}\0{content}\n".encode())
    return digest.hexdigest()[:DIGITS]
