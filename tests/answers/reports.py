"""Reports of the pipeline as plain trees; their arrays by dtype, shape and digest."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.answers.tree import Tree, array_digest

DIGITS = 16
PLAIN = (str, int, float, bool, type(None))


def plain(thing: Any) -> Tree:
    """Return a dataclass, a container or a value as a plain tree.

    Public fields only. An array becomes `dtype(shape) digest`, and an object without fields its type's name.
    """
    if isinstance(thing, np.generic):
        return thing.item()
    if isinstance(thing, enum.Enum):
        return thing.name
    if isinstance(thing, PLAIN):
        return thing
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype}{list(thing.shape)} {array_digest(thing)[:DIGITS]}"
    if dataclasses.is_dataclass(thing):
        names = [field.name for field in dataclasses.fields(thing) if not field.name.startswith("_")]
        return {name: plain(getattr(thing, name)) for name in names}
    if isinstance(thing, Mapping):
        return {str(key): plain(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [plain(value) for value in thing]
    return type(thing).__name__
