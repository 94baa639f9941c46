"""Markdown pages as trees: each value of a table has its own key path."""

from __future__ import annotations

from collections.abc import Iterable

from tests.answers.tree import Tree


def sections(text: str) -> dict[str, list[Tree]]:
    """Return a page's lines by heading; a row of a table is `{first cell: {column: cell}}`.

    Headings and columns of one name are numbered from the second on.
    """
    found: dict[str, list[Tree]] = {"": []}
    lines, columns = found[""], list[str]()
    for line in text.splitlines():
        if line.startswith("#"):
            lines = found[_unused(line.lstrip("# "), found)] = []
        elif not line.startswith("|"):
            columns = []
            lines.append(line)
        elif not columns:
            columns = _numbered(_cells(line))
            lines.append(line)
        elif set(line) <= set("|-: "):
            lines.append(line)
        else:
            first, *others = _cells(line)
            lines.append({first: dict(zip(columns[1:], others, strict=False))})
    return found


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def _numbered(names: list[str]) -> list[str]:
    found: list[str] = []
    for name in names:
        found.append(_unused(name, found))
    return found


def _unused(name: str, used: Iterable[str]) -> str:
    number, one = 1, name
    while one in used:
        number += 1
        one = f"{name} ({number})"
    return one
