"""Typed fields of a JSON object in an artefact, with errors that name the file."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from typing import Any

from companion.runtime.errors import UsageError


class ArtefactError(UsageError):
    """An artefact that cannot be read; one line names it, the place and the fault."""


class RepeatedKeyError(ArtefactError):
    """An object in an artefact that has a key twice: which of its values holds cannot be told."""


@dataclass(frozen=True, slots=True)
class Fields:
    """A JSON object and where it is, such as `flights.jsonl, line 3`."""

    where: str
    values: dict[str, Any]

    @classmethod
    def parse(cls, where: str, text: str) -> Fields:
        """Read a JSON object.

        Raises
        ------
        ArtefactError
            It is none.
        RepeatedKeyError
            An object of it has a key twice.
        """

        def unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
            found = dict(pairs)
            if len(found) < len(pairs):
                key = next(key for key, times in Counter(key for key, _ in pairs).items() if times > 1)
                raise RepeatedKeyError(
                    f"--artefact {where}: the key {key!r:.40} is there twice in one object: keep one"
                )
            return found

        try:
            values = json.loads(text, object_pairs_hook=unrepeated)
        except ArtefactError:
            raise
        except (ValueError, RecursionError) as error:
            raise ArtefactError(f"--artefact {where}: no JSON: {str(error).splitlines()[0]}") from None
        if not isinstance(values, dict):
            raise ArtefactError(f"--artefact {where}: a JSON object was expected")
        return cls(where, values)

    def count(self, name: str, default: int | None = None) -> int:
        """Return a number of things, which is never negative."""
        value = self.values.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.bad(name, "a whole number from 0")
        return value

    def text(self, name: str, default: str | None = None) -> str:
        """Return a text."""
        value = self.values.get(name, default)
        if not isinstance(value, str):
            raise self.bad(name, "a text")
        return value

    def choice(self, name: str, choices: tuple[str, ...], default: str | None = None) -> str:
        """Return one of several words."""
        value = self.text(name, default)
        if value not in choices:
            raise self.bad(name, " or ".join(choices))
        return value

    def flag(self, name: str) -> bool:
        """Return a truth value; null is false."""
        value = self.values.get(name)
        if value is not None and not isinstance(value, bool):
            raise self.bad(name, "true or false")
        return value is True

    def items(self, name: str) -> list[Any]:
        """Return a list."""
        value = self.values.get(name)
        if not isinstance(value, list):
            raise self.bad(name, "a list")
        return value

    def part(self, name: str) -> Fields:
        """Return an object within the object."""
        value = self.values.get(name)
        if not isinstance(value, dict):
            raise self.bad(name, "an object")
        return Fields(f"{self.where}, {name!r}", value)

    def bad(self, name: str, wanted: str) -> ArtefactError:
        """Return the error of a field that is missing or of another type."""
        found = "is missing" if name not in self.values else f"is {self.values[name]!r:.40}"
        return ArtefactError(f"--artefact {self.where}: {name!r} {found}: {wanted} was expected")
