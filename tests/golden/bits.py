"""Digests of every bit of golden results, to compare two computers (`python -m tests.golden.bits zones`)."""

from __future__ import annotations

import hashlib
import json
import logging
import platform
import sys
import time
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from tests.golden.fingerprint import TIMES


def digests(thing: Any, name: str = "") -> dict[str, str]:
    """Return a digest of every array and number by the place where it stands; all NaN are one."""
    if isinstance(thing, np.ndarray | np.generic | float | int) or thing is None or isinstance(thing, str):
        return {name: _digest(thing)}
    if is_dataclass(thing):
        parts = [(f".{f.name}", getattr(thing, f.name)) for f in fields(thing) if f.name not in TIMES]
    elif isinstance(thing, dict):
        parts = [(f"[{key}]", value) for key, value in thing.items()]
    elif isinstance(thing, list | tuple):
        parts = [(f"[{k}]", part) for k, part in enumerate(thing)]
    else:
        parts = [("", repr(getattr(thing, "value", type(thing))))]
    found: dict[str, str] = {}
    for suffix, part in parts:
        found |= digests(part, name + suffix)
    return found


def _digest(thing: Any) -> str:
    if thing is None or isinstance(thing, str):
        return str(thing)
    array = np.ascontiguousarray(thing)
    if array.dtype.kind == "f":
        array = np.where(np.isnan(array), np.array(np.nan, array.dtype), array)
    return f"{array.dtype.str} {array.shape} {hashlib.sha256(array.tobytes()).hexdigest()[:16]}"


def main() -> None:
    """Print the digests of the named results as JSON, and to stderr how long each took."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    from tests.golden.flights import KEPT

    found = {}
    for name in sys.argv[1:] or KEPT:
        begun_s = time.perf_counter()
        found[name] = [digests(thing) for thing in KEPT[name]()]
        print(f"{name}: {time.perf_counter() - begun_s:.1f} s", file=sys.stderr)
    print(json.dumps({"machine": platform.machine(), "digests": found}))


if __name__ == "__main__":
    main()
