"""Typed fields of a JSON object in an artefact, with errors that name the file."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from typing import Any

from companion.runtime.errors import UsageError

MOST_COUNT = 10**12
MOST_SEED = 2**64


class ArtefactError(UsageError):
    """An artefact that cannot be read; one line names it, the place and the fault."""


class NoJsonError(ArtefactError):
    """A text that is no JSON, such as a line that was cut off."""


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
        NoJsonError
            It is no JSON.
        ArtefactError
            It is no object, an object of it has a key twice, or a text of it is no Unicode.
        """

        def unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
            found = dict(pairs)
            if len(found) < len(pairs):
                key = next(key for key, times in Counter(key for key, _ in pairs).items() if times > 1)
                raise ArtefactError(
                    f"--artefact {where}: the key {key!r:.40} is there twice in one object: keep one"
                )
            return found

        try:
            values = json.loads(text, object_pairs_hook=unrepeated)
            if "\\u" in text:
                json.dumps(values, ensure_ascii=False).encode()
        except json.JSONDecodeError as error:
            raise NoJsonError(f"--artefact {where}: no JSON: {error}") from None
        except UnicodeEncodeError as error:
            code = f"\\u{ord(error.object[error.start]):04x}"
            raise ArtefactError(
                f"--artefact {where}: {code} is half a character (a lone surrogate): write the whole one"
            ) from None
        except (ValueError, RecursionError) as error:
            raise ArtefactError(f"--artefact {where}: JSON that cannot be read: {error}") from None
        if not isinstance(values, dict):
            raise ArtefactError(f"--artefact {where}: a JSON object was expected")
        return cls(where, values)

    def count(self, name: str, default: int | None = None) -> int:
        """Return a number of things, from 0 to 10^12."""
        return self._whole(name, default, MOST_COUNT, "10^12")

    def seed(self, name: str, default: int | None = None) -> int:
        """Return a number that identifies a run, from 0 to 2^64."""
        return self._whole(name, default, MOST_SEED, "2^64")

    def _whole(self, name: str, default: int | None, most: int, most_text: str) -> int:
        value = self.values.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
            raise self.bad(name, f"a whole number from 0 to {most_text}")
        return value

    def version(self, wanted: int) -> None:
        """Check the version of a document's format."""
        value = self.values.get("version")
        if type(value) is not int or value != wanted:
            raise self.bad("version", str(wanted))

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
