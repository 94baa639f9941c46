"""Answers as trees of plain values and arrays, in one canonical form."""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Tree = Any
"""Nested dicts, lists, texts, numbers, None and numpy arrays."""
ARRAY = "$array"
FLOAT = "$float"


def packed(tree: Tree, arrays: list[NDArray[Any]]) -> Tree:
    """Return a tree that JSON can hold; its arrays are appended to `arrays`.

    An array becomes its number, dtype, shape and SHA-256; NaN and infinity become texts. Floats keep every
    bit: JSON holds the shortest decimal that reads back as the same double.
    """
    if isinstance(tree, dict):
        return {str(key): packed(value, arrays) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [packed(value, arrays) for value in tree]
    if isinstance(tree, np.ndarray):
        arrays.append(np.ascontiguousarray(tree))
        return {ARRAY: [len(arrays) - 1, tree.dtype.str, list(tree.shape), array_digest(tree)]}
    if isinstance(tree, np.generic):
        return packed(tree.item(), arrays)
    if isinstance(tree, float) and not math.isfinite(tree):
        return {FLOAT: repr(tree)}
    return tree


def unpacked(tree: Tree, arrays: list[NDArray[Any]]) -> Tree:
    """Return the tree that `packed` was given."""
    if isinstance(tree, list):
        return [unpacked(value, arrays) for value in tree]
    if isinstance(tree, dict):
        if tree.keys() == {ARRAY}:
            return arrays[tree[ARRAY][0]]
        if tree.keys() == {FLOAT}:
            return float(tree[FLOAT])
        return {key: unpacked(value, arrays) for key, value in tree.items()}
    return tree


def array_digest(array: NDArray[Any]) -> str:
    """Return the SHA-256 of an array's elements in C order."""
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def digest(tree: Tree) -> str:
    """Return the SHA-256 of a tree: of its canonical JSON, in which arrays stand for theirs."""
    text = json.dumps(packed(tree, []), sort_keys=True, ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
