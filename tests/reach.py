"""Test modules that reach a file (`python -m tests.reach FILE`), by their imports or the names they mention.

A test reaches a module if it imports it (or a helper does), or lies in its folder under `tests/unit`. If
none does, those that import an importer count, and so on. Flights (`tests/e2e`) do not count.
"""

from __future__ import annotations

import ast
import functools
import sys
from pathlib import Path

from tests import REPOSITORY

ROOTS = ("slz", "companion", "params", "sitl", "tests")
TESTS = REPOSITORY / "tests"
FARTHEST = 6


@functools.cache
def imported(path: Path) -> frozenset[Path]:
    """Return the files of the repository that a module imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    bases = [REPOSITORY / name.replace(".", "/") for name in names if name.split(".")[0] in ROOTS]
    files = (p for base in bases for p in (base.with_suffix(".py"), base / "__init__.py"))
    return frozenset(filter(Path.is_file, files))


def used(test: Path) -> set[Path]:
    """Return what a test imports, itself or by its helpers."""
    found, waiting = {test}, [test]
    while waiting:
        new = imported(waiting.pop()) - found
        found |= new
        waiting += [path for path in new if path.is_relative_to(TESTS)]
    return found


def reaching(file: Path) -> list[Path]:
    """Return the test modules that reach a file, the nearest alone."""
    tests = sorted(p for p in TESTS.rglob("test_*.py") if "e2e" not in p.parts or p == file)
    if file.suffix != ".py":
        return [test for test in tests if file.name in test.read_text("utf-8")]
    modules = [p for root in ROOTS[:-1] for p in (REPOSITORY / root).rglob("*.py")]
    beside, near = TESTS / "unit" / file.relative_to(REPOSITORY).parent, {file}
    for _ in range(FARTHEST):
        found = [test for test in tests if used(test) & near or test.parent == beside]
        if found or file.is_relative_to(TESTS):
            break
        near |= {module for module in modules if imported(module) & near}
    return found


if __name__ == "__main__":
    print(*(path.relative_to(REPOSITORY) for path in reaching(Path(sys.argv[1]).resolve())))
