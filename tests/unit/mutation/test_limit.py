"""The limit of processor time: what takes longer is skipped and named, what does not is left alone."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

TESTS = """
import pytest

@pytest.mark.parametrize("case", range(3))
def test_endless(case):
    while True:
        pass

def test_short():
    pass

@pytest.fixture
def endless():
    while True:
        pass

def test_endless_preparation(endless):
    pass
"""


def test_what_takes_too_long_is_skipped_with_its_other_cases_and_what_passed_is_costed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    pytester.makepyfile(TESTS)
    run = pytester.runpytest_subprocess(
        "-p",
        "tests.coverage.plugin",
        "-p",
        "no:cacheprovider",
        "--processor-limit",
        "0.2",
        "--costs",
        "costs",
        "-rs",
    )
    run.assert_outcomes(passed=1, skipped=4)
    run.stdout.fnmatch_lines_random(
        ["*2*another case took too long*", "*1*more than 0.2 s of processor time*"]
    )
    costs = json.loads((pytester.path / "costs").read_text())
    assert [name.partition("::")[2] for name in costs] == ["test_short"]
