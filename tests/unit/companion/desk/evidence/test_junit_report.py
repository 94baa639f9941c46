"""Reports of tests: their header agrees with the test cases, and each case is of its own suite."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from companion.desk.evidence.artefact_file import read_junit
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.evidence.results import NOW, OLD, case

TESTS = """
import pytest

@pytest.fixture
def breaks():
    yield
    raise RuntimeError("teardown")

@pytest.fixture
def broken():
    raise RuntimeError("setup")

def test_passes(): pass
def test_fails(): assert False
def test_is_skipped(): pytest.skip("no")
@pytest.mark.xfail
def test_fails_as_expected(): assert False
@pytest.mark.xfail
def test_passes_unexpectedly(): pass
@pytest.mark.xfail(strict=True)
def test_must_fail(): pass
def test_passes_and_breaks(breaks): pass
def test_fails_and_breaks(breaks): assert False
def test_is_skipped_and_breaks(breaks): pytest.skip("no")
@pytest.mark.xfail
def test_breaks_as_expected(breaks): assert False
def test_is_broken(broken): pass
"""
FAILED = ["fails", "must_fail", "passes_and_breaks", "fails_and_breaks", "is_skipped_and_breaks", "is_broken"]


def suite(inside: str, program: str = NOW, **header: int | str) -> str:
    numbers = " ".join(f"{name}='{number}'" for name, number in header.items())
    given = f"<properties><property name='slz_program' value='{program}'/></properties>" if program else ""
    return f"<testsuite {numbers}>{given}{inside}</testsuite>"


def read(inside: str) -> list[tuple[str, str, int]]:
    """Return name, version and failures of each run."""
    found = read_junit("junit.xml", f"<testsuites>{inside}</testsuites>")
    return [(run.variant.partition("::")[2], run.program, run.failures) for run in found]


def refused(inside: str) -> str:
    with pytest.raises(UsageError) as error:
        read(inside)
    return str(error.value)


def test_a_report_of_pytest_is_read(tmp_path: Path) -> None:
    (tmp_path / "test_all.py").write_text(TESTS, "utf-8")
    (tmp_path / "test_none.py").write_text("import nothing_of_this_name\n", "utf-8")
    words = ["-q", "--junitxml=junit.xml", "--continue-on-collection-errors", "-p", "no:cacheprovider"]
    plain = os.environ | {"PYTEST_ADDOPTS": "", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-m", "pytest", *words, "--rootdir=."]
    subprocess.run(command, cwd=tmp_path, env=plain, capture_output=True, check=False)
    runs = read_junit("junit.xml", (tmp_path / "junit.xml").read_text("utf-8"))
    failed = {run.variant.rpartition("::")[2] for run in runs if run.failures}
    assert failed == {f"test_{name}" for name in FAILED} | {"test_none"}
    assert len({run.variant for run in runs}) == 12


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ({"tests": 5}, "<testsuite> has tests='5', and below it are 3 to 4: run the tests again"),
        ({"tests": 2}, "tests='2', and below it are 3 to 4"),
        ({"tests": 3, "failures": 0}, "failures='0', and below it are 1"),
        ({"tests": 3, "failures": 2}, "failures='2', and below it are 1"),
        ({"tests": 3, "failures": 1, "errors": 2}, "errors='2', and below it are 1"),
        ({"tests": 3, "failures": 1, "errors": 1, "skipped": 1}, "skipped='1', and below it are 0"),
        ({"tests": "many"}, "tests='many'"),
        ({"tests": "9" * 5_000}, "tests='9999"),
    ],
)
def test_a_header_that_does_not_agree_with_its_tests_is_refused(
    header: dict[str, int | str], said: str
) -> None:
    cases = case("test_a") + case("test_b", "<failure/>") + case("test_c", "<error/>")
    text = refused(suite(cases, **header))
    assert text.startswith("--artefact junit.xml: ")
    assert said in text


def test_a_header_that_agrees_is_read() -> None:
    cases = (
        case("test_a") + case("test_b", "<failure/>") + case("test_c", "<error/>") + case("d", "<skipped/>")
    )
    for tests in (4, 5):
        assert len(read(suite(cases, tests=tests, failures=1, errors=1, skipped=1))) == 4


def test_the_header_of_all_suites_is_compared_with_the_tests_of_all() -> None:
    inside = suite(case("test_a"), tests=1) + suite(case("test_b"), tests=1)
    assert len(read_junit("junit.xml", f"<testsuites tests='2'>{inside}</testsuites>")) == 2
    with pytest.raises(UsageError, match="<testsuites> has tests='3'"):
        read_junit("junit.xml", f"<testsuites tests='3'>{inside}</testsuites>")


def test_a_test_of_a_suite_in_a_suite_is_read_once_with_the_version_of_its_own() -> None:
    inner = suite(case("test_a", "<failure/>"), OLD, tests=1) + suite(case("test_b"), "")
    assert sorted(read(suite(inner + case("test_c"), tests=3))) == [
        ("test_a", OLD, 1),
        ("test_b", "", 0),
        ("test_c", NOW, 0),
    ]


def test_a_test_outside_of_a_suite_is_refused() -> None:
    assert "not directly in a <testsuite>" in refused(suite(case("test_a")) + case("test_b", "<failure/>"))


def test_the_report_of_interrupted_tests_is_refused() -> None:
    text = refused(suite(case("test_a") + "<testcase time='0.0'/>", tests=1))
    assert "without a name: the tests were interrupted: run them again" in text
