"""Type hashes (REP 2016) from the text of message definitions: an algorithm of the tests' own."""

from __future__ import annotations

import hashlib
import json
from typing import Any

# type_description_interfaces/msg/FieldType.
NUMBERS = {
    "int32": 6,
    "uint32": 7,
    "uint16": 5,
    "float32": 10,
    "float64": 11,
    "string": 17,
}
UNBOUNDED_SEQUENCE = 144
NESTED = 1


def type_hash(name: str, definitions: dict[str, str]) -> str:
    """Return the hash of a type; definitions: text of it and of all types that it holds, by name."""
    described = {
        "type_description": _described(name, definitions),
        "referenced_type_descriptions": [_described(one, definitions) for one in _held(name, definitions)],
    }
    text = json.dumps(described, ensure_ascii=True, separators=(", ", ": "))
    return "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()


def _fields(name: str, definitions: dict[str, str]) -> list[tuple[str, str]]:
    lines = (line.partition("#")[0].split() for line in definitions[name].splitlines())
    return [(kind, field) for kind, field in (line for line in lines if line)]


def _full(kind: str) -> str:
    package, _, short = kind.removesuffix("[]").partition("/")
    return f"{package}/msg/{short}"


def _described(name: str, definitions: dict[str, str]) -> dict[str, Any]:
    fields = []
    for kind, field in _fields(name, definitions):
        plain = kind.removesuffix("[]")
        number = NUMBERS.get(plain, NESTED) + (UNBOUNDED_SEQUENCE if kind.endswith("[]") else 0)
        nested = "" if plain in NUMBERS else _full(kind)
        form = {"type_id": number, "capacity": 0, "string_capacity": 0, "nested_type_name": nested}
        fields.append({"name": field, "type": form})
    return {"type_name": name, "fields": fields}


def _held(name: str, definitions: dict[str, str]) -> list[str]:
    found: set[str] = set()
    for kind, _ in _fields(name, definitions):
        if kind.removesuffix("[]") not in NUMBERS:
            found |= {_full(kind), *_held(_full(kind), definitions)}
    return sorted(found)
