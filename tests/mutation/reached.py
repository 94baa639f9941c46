"""Tests that reach a line, cheapest first, from the contexts and costs of `make coverage`."""

from __future__ import annotations

import ast
import json
from collections import Counter
from pathlib import Path

from coverage import CoverageData


def statement(source: str, line: int) -> range:
    """Return the lines of the innermost statement around a line, of a compound one its head alone."""
    best = range(line, line + 1)
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.stmt) or node.end_lineno is None:
            continue
        body = getattr(node, "body", None)
        end = body[0].lineno - 1 if isinstance(body, list) and body else node.end_lineno
        if node.lineno <= line <= max(end, node.lineno):
            best = range(node.lineno, max(end, node.lineno) + 1)
    return best


class Reached:
    """The tests that reached each line of each file without the compiler."""

    def __init__(self, data_file: Path, costs_file: Path) -> None:
        if not data_file.is_file() or not costs_file.is_file():
            raise FileNotFoundError(f"{data_file} or {costs_file} is missing: run `make coverage` first")
        self._data = CoverageData(basename=str(data_file))
        self._data.read()
        self._costs_s: dict[str, float] = json.loads(costs_file.read_text())

    def by_line(self, path: Path, line: int) -> list[str]:
        """Return the tests that ran a line's statement; of one function's cases the cheapest come first."""
        contexts = self._data.contexts_by_lineno(str(path))
        return self._ordered({t for k in statement(path.read_text(), line) for t in contexts.get(k, [])})

    def by_file(self, path: Path) -> list[str]:
        """Return the tests that ran anything of a file."""
        contexts = self._data.contexts_by_lineno(str(path))
        return self._ordered({t for tests in contexts.values() for t in tests})

    def cost_s(self, test: str) -> float:
        """Return what a test cost without the compiler."""
        return self._costs_s[test]

    def _ordered(self, tests: set[str]) -> list[str]:
        cases: Counter[str] = Counter()
        turns: list[tuple[int, float, str]] = []
        for test in sorted(tests & self._costs_s.keys(), key=self._costs_s.__getitem__):
            function = test.partition("[")[0]
            turns.append((cases[function], self._costs_s[test], test))
            cases[function] += 1
        return [test for *_, test in sorted(turns)]

    def within(self, tests: list[str], budget_s: float) -> list[str]:
        """Return tests in their order as long as they cost no more than a budget; at least one."""
        chosen: list[str] = []
        for test in tests:
            if chosen and self.cost_s(test) > budget_s:
                continue
            chosen.append(test)
            budget_s -= self.cost_s(test)
        return chosen
