"""File of flights, a line of JSON each, that a later run of the same program goes on with."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from companion.runtime.program_version import program_version

Flown = dict[str, Any]


class InputError(ValueError):
    """A file, option or scenario that cannot be used; the message is one line for the user."""


def read_object(path: Path) -> dict[str, Any]:
    """Return the JSON object of a file; raise InputError if it holds none."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as JSON: {error}") from None
    if not isinstance(found, dict):
        raise InputError(f"{path} is no JSON object, but {type(found).__name__}")
    return found


class FlownFile:
    """Flights in their order; the first line says by which program, and of which search, they are.

    Parameters
    ----------
    path
        JSON lines.
    search
        What beside the program's version makes the flights, such as the seed.
    fields
        What every flight has.

    Attributes
    ----------
    flown
        All flights so far.

    Raises
    ------
    InputError
        The file is of another program or search, or a line is damaged.
    """

    def __init__(self, path: Path, search: dict[str, Any], fields: Collection[str]) -> None:
        self._path, self._fields = path, fields
        self._head = {"program": program_version()} | search
        self.flown = self._read()

    def add(self, flown: Flown) -> None:
        """Append a flight."""
        is_new = not self._path.exists()
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as out:
            out.write(json.dumps(self._head) + "\n" if is_new else "")
            out.write(json.dumps(flown) + "\n")
        self.flown.append(flown)

    def _read(self) -> list[Flown]:
        """Return the flights; a last line cut short by a stop is removed from the file."""
        if not self._path.exists():
            return []
        try:
            text = self._path.read_text("utf-8")
        except UnicodeDecodeError as error:
            raise InputError(f"{self._path} is no UTF-8 text: {error}: use another folder") from None
        whole = text[: text.rfind("\n") + 1]
        lines = []
        for number, line in enumerate(whole.splitlines(), 1):
            try:
                lines.append(json.loads(line))
            except (ValueError, RecursionError):
                raise InputError(f"{self._path}: line {number} is no JSON: use another folder") from None
        if not lines or lines[0] != self._head:
            raise InputError(
                f"{self._path} was flown by another version of the program, or another search: it says"
                f" {str(lines[0])[:80] if lines else 'nothing'}, this is {self._head}: use another folder"
            )
        for number, line in enumerate(lines[1:], 2):
            if not isinstance(line, dict) or not line.keys() >= set(self._fields):
                raise InputError(f"{self._path}: line {number} is no flight: use another folder")
        if whole != text:
            self._path.write_text(whole, "utf-8")
        return lines[1:]
