"""Links of the hazard list: code, tests, faults, harnesses and rows of docs/reactions.md that exist."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

from companion.desk.evidence.hazard_list import Role, assurance_parts, hazards
from tests import REPOSITORY

REACTIONS = (REPOSITORY / "docs" / "reactions.md").read_text("utf-8")
CODE = [*(b for h in hazards() for b in h.barriers), *(c for part in assurance_parts() for c in part.code)]
TESTS = [node for h in hazards() for node in h.tests]


@functools.cache
def names(path: Path) -> frozenset[str]:
    """Return the functions and classes of a module; nothing is imported."""
    body = ast.parse(path.read_text("utf-8")).body
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    return frozenset(node.name for node in body if isinstance(node, kinds))


def rows(heading: str) -> list[str]:
    """Return the first cells of the first table below a heading."""
    lines = REACTIONS.split(f"## {heading}")[1].split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith("|---"))
    cells = []
    for line in lines[first + 1 :]:
        if not line.startswith("|"):
            break
        cells.append(line.split("|")[1].strip())
    return cells


def constants(path: str, function: str) -> set[str]:
    """Return the texts that are the first argument of a function's calls in a file."""
    tree = ast.parse((REPOSITORY / path).read_text("utf-8"))
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == function]
    return {call.args[0].value for call in calls if isinstance(call.args[0], ast.Constant)}  # type: ignore[misc]


def linked(kind: str) -> set[str]:
    return {name for h in hazards() for name in getattr(h, kind)}


def test_code_that_is_named_exists() -> None:
    assert len(CODE) > 100
    for name in CODE:
        module, _, inside = name.partition(":")
        assert inside in names(REPOSITORY / (module.replace(".", "/") + ".py")), name


def test_tests_that_are_named_exist() -> None:
    assert len(TESTS) > 100
    for node in TESTS:
        file, _, function = node.partition("::")
        found = {name for name in names(REPOSITORY / file) if name.startswith("test_")}
        assert function in found if function else found, node


def test_faults_flights_and_harnesses_are_linked_and_those_named_exist() -> None:
    page = (REPOSITORY / "docs/faults.md").read_text("utf-8")
    faults = set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))
    landings = ast.parse((REPOSITORY / "tests/bench/landings.py").read_text("utf-8"))
    kinds = next(
        ast.literal_eval(node.value)
        for node in landings.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "KINDS"
    )
    fuzz = [f"tests/fuzz/{name}.py" for name in ("wire", "files", "texts")]
    harnesses = set().union(*(constants(path, "Harness") for path in fuzz))
    user = {"mavlink-url", "lidar-url", "page-address"}  # of the command line: no hazard of a landing
    assert len(faults) > 40
    assert linked("campaign") == faults
    assert linked("landings") == set(kinds)
    assert linked("fuzz") == harnesses - user
    assert linked("soak") == {"simulated", "real"}
    assert linked("measures") == {"touchdowns", "collisions", "commands"}


def test_every_presumption_of_the_reactions_is_broken_by_a_hazard_and_no_other_is_named() -> None:
    table = rows("Assumptions about the vehicle, by stage")
    assert len(table) == 18
    assert linked("presumptions") == set(table)


def test_everything_that_fails_in_the_reactions_is_of_a_hazard_and_nothing_else_is_named() -> None:
    table = rows("What fails")
    assert len(table) > 25
    assert [row for row in table if not any(row.startswith(name) for name in linked("failures"))] == []
    assert [name for name in linked("failures") if sum(row.startswith(name) for row in table) != 1] == []


def test_a_hazard_has_a_number_of_its_own_barriers_and_evidence_to_ask_for() -> None:
    assert [h.id for h in hazards()] == [f"H{k + 1:02}" for k in range(len(hazards()))]
    assert len(hazards()) > 40
    assert all(h.barriers and h.tests for h in hazards())
    assert len({h.title for h in hazards()}) == len(hazards())


def test_every_role_of_run_time_assurance_has_a_part() -> None:
    assert {part.role for part in assurance_parts()} == set(Role)
    assert all(part.code for part in assurance_parts())
