"""Check of constraints: unpinned or unavailable packages are named; no answer is no success."""

from __future__ import annotations

import tomllib
from typing import Any

from companion.runtime import extras
from tests.constraints import ALONE, DID_NOT_RUN, EXTRAS, ROOT, pinned, requirements, verdict

PINS = pinned("numpy==2.4.6\nlazy-importer==0.1.0\n")


def report(*names: str) -> dict[str, Any]:
    return {"install": [{"metadata": {"name": name}} for name in names]}


def test_names_are_compared_as_the_index_does() -> None:
    assert verdict("3.12", "aarch64", report("NumPy", "lazy_importer"), "", PINS) == (
        "Python 3.12, aarch64: 2 packages, all pinned",
        0,
    )


def test_a_package_that_is_not_pinned_is_named() -> None:
    text, code = verdict("3.12", "aarch64", report("numpy", "stranger"), "", PINS)
    assert (text, code) == ("Python 3.12, aarch64: not in constraints.txt: stranger", 1)


def test_a_version_that_a_python_cannot_have_fails_with_pips_own_words() -> None:
    said = "WARNING: old\nERROR: Could not find a version of pymdown-extensions==13.1"
    text, code = verdict("3.11.2", "x86_64", None, said, PINS)
    first, second = text.splitlines()
    assert first == "Python 3.11.2, x86_64: the pinned versions cannot be installed together"
    assert second.endswith("pymdown-extensions==13.1")
    assert code == 1


def test_an_index_that_does_not_answer_says_that_it_did_not_run() -> None:
    for said in ("", "WARNING: Retrying (Retry(total=4))\nERROR: No matching distribution"):
        text, code = verdict("3.11.2", "x86_64", None, said, PINS)
        assert text.startswith(DID_NOT_RUN)
        assert code == 0


def test_what_is_asked_is_what_the_makefile_installs() -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    assert "--editable '.[dev,docs]'" in makefile
    assert f"--no-deps {' '.join(ALONE)}" in makefile
    wanted = requirements(tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"])
    assert {"numpy>=2.0", "ruff>=0.9", "mkdocs-material>=9.6"} <= set(wanted)


def test_every_extra_of_the_program_is_asked_for() -> None:
    assert set(extras.PACKAGES) - {"ouster"} <= set(EXTRAS)
