"""Mutants of a source file, with the operators of cosmic-ray, and a seeded sample of them."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import parso  # before cosmic-ray, which imports its parts in an order that fails

# isort: split
from cosmic_ray.ast import ast_nodes
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

WITHOUT_ARGUMENTS = [
    n for n in operator_names() if n not in ("core/VariableReplacer", "core/VariableInserter")
]
NEVER_CHANGED = ("name", "string", "newline", "endmarker")


@dataclass(frozen=True, slots=True, order=True)
class Mutant:
    """One change: the n-th place of a file where an operator fits, and that place."""

    path: str
    line: int
    column: int
    operator: str
    occurrence: int

    @property
    def name(self) -> str:
        """Return the mutant in a word that finds it again."""
        return f"{self.path}:{self.line}:{self.column} {self.operator}#{self.occurrence}"


class _Meaning(ast.NodeTransformer):
    """What is left of a tree when everything is gone that no test can tell from its absence."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        node.decorator_list = [d for d in node.decorator_list if "kernel" not in ast.unparse(d)]
        for argument in ast.walk(node.args):
            if isinstance(argument, ast.arg):
                argument.annotation = None
        return self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)


def meaning(source: str) -> str:
    """Return what a module does, without annotations and the compiler of kernels, which is off."""
    return ast.dump(_Meaning().visit(ast.parse(source)))


def _operator(name: str) -> Any:
    return get_operator(name)()


def changed(source: str, mutant: Mutant) -> str:
    """Return the source with a mutant in it.

    Raises
    ------
    ValueError
        If the source has no such place, as it was edited since.
    """
    text = mutate_code(source, _operator(mutant.operator), mutant.occurrence)
    if text is None:
        raise ValueError(f"{mutant.name}: there is no such place; sample anew, the file was edited")
    return str(text)


def _places(path: str, source: str) -> Iterator[Mutant]:
    operators = [(name, _operator(name)) for name in WITHOUT_ARGUMENTS]
    seen = dict.fromkeys(WITHOUT_ARGUMENTS, 0)
    for node in ast_nodes(parso.parse(source)):
        if node.type in NEVER_CHANGED:
            continue
        for name, operator in operators:
            for (line, column), _ in operator.mutation_positions(node):
                yield Mutant(path, line, column, name, seen[name])
                seen[name] += 1


def of_file(root: Path, path: str) -> list[Mutant]:
    """Return every mutant of a file, those included that change nothing."""
    return list(_places(path, (root / path).read_text()))


def sample(root: Path, paths: Sequence[str], seed: int, count: int) -> list[Mutant]:
    """Return mutants drawn evenly from all files together: each has its share; none without effect."""
    everything = [mutant for path in sorted(paths) for mutant in of_file(root, path)]
    Random(seed).shuffle(everything)
    source = functools.cache(lambda path: (root / path).read_text())
    before = functools.cache(lambda path: meaning(source(path)))
    kept: list[Mutant] = []
    for mutant in everything:
        if len(kept) == count:
            break
        try:
            if meaning(changed(source(mutant.path), mutant)) != before(mutant.path):
                kept.append(mutant)
        except SyntaxError:  # what is no program is no mutant
            continue
    return kept
