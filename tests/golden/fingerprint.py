"""Fingerprint of an answer: a few sums that any changed cell alters."""

from __future__ import annotations

import enum
import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

TIMES = frozenset({"stage_ms", "total_ms"})
UNKNOWN = -1e99  # in the place of NaN, which is equal to nothing
FEW = 4  # numbers of an array that are kept as they are


def fingerprint(thing: Any, name: str = "") -> dict[str, list[float]]:
    """Return numbers by the place where they stand; arrays give counts, and sums with weights of chance."""
    if thing is None or isinstance(thing, enum.Enum | str):
        return {f"{name} {getattr(thing, 'value', thing)}": []}
    if isinstance(thing, bool | int | float | np.number | np.bool_):
        return {name: [_number(thing)]}
    if isinstance(thing, np.ndarray):
        return _of_array(thing, name)
    if is_dataclass(thing):
        parts = [(f".{f.name}", getattr(thing, f.name)) for f in fields(thing) if f.name not in TIMES]
        parts += [(f".{part}", value) for part, value in _derived(thing)]
    elif isinstance(thing, dict):
        parts = [(f"[{key}]", value) for key, value in thing.items()]
    else:
        parts = [(f"[{k}]", part) for k, part in enumerate(thing)]
    found = {} if parts else {f"{name} empty": []}
    for suffix, part in parts:
        found |= fingerprint(part, name + suffix)
    return found


def _derived(thing: Any) -> list[tuple[str, float]]:
    """Return the properties of a dataclass that are numbers."""
    names = [name for name in dir(type(thing)) if isinstance(getattr(type(thing), name, None), property)]
    values = [(name, getattr(thing, name)) for name in names if name not in TIMES]
    return [(name, value) for name, value in values if isinstance(value, bool | int | float)]


def _number(value: Any) -> float:
    return float(f"{value:.10g}") if math.isfinite(value) else UNKNOWN


def _of_array(array: np.ndarray[Any, Any], name: str) -> dict[str, list[float]]:
    label = f"{name} {array.shape}"
    if array.dtype == object:
        return {label: [float(array.size)]}
    values = (np.stack([array.real, array.imag]) if np.iscomplexobj(array) else array).astype(float).ravel()
    known = np.isfinite(values)
    if len(values) <= FEW:
        return {label: [_number(v) for v in values]}
    chance = np.random.default_rng(len(values)).random((2, len(values)))
    found = np.where(known, values, 0.0)
    return {
        label: [float(known.sum()), float(chance[0] @ known), *(chance @ found), float(np.abs(found).sum())]
    }


def differences(kept: dict[str, list[float]], found: dict[str, list[float]], rtol: float) -> list[str]:
    """Return the places at which two fingerprints differ; sums may by so much of the sum of magnitudes."""
    places = [f"gone: {name}" for name in kept.keys() - found.keys()]
    places += [f"new: {name}" for name in found.keys() - kept.keys()]
    for name in kept.keys() & found.keys():
        a, b = np.array(kept[name]), np.array(found[name])
        most = rtol * max(1e-3, a[-1] if len(a) == 5 else float(np.abs(a).max(initial=0.0)))
        if len(a) != len(b) or not (np.abs(a - b) <= most).all():
            places.append(f"{name}: {kept[name]} -> {found[name]}")
    return sorted(places)
