"""Limit of processor time: slower tests are skipped and named, others are unaffected."""

from __future__ import annotations

import json
import signal
from collections.abc import Generator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coverage
import pytest

from tests import REPOSITORY
from tests.coverage import plugin

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
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
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


def test_a_test_is_not_ended_while_the_tracer_may_hold_its_lock(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []
    monkeypatch.setattr(signal, "setitimer", lambda _which, seconds: asked.append(seconds))
    monkeypatch.setattr(plugin, "too_long", set())
    config = SimpleNamespace(getoption=lambda _name: 3.0)
    item = SimpleNamespace(config=config, nodeid="a.py::test_a")
    limited: Generator[None, object, object] = plugin._limited(item)  # type: ignore[arg-type]
    next(limited)
    end: Any = signal.getsignal(signal.SIGVTALRM)
    code = compile("", str(Path(coverage.__file__).parent / "collector.py"), "exec")
    end(signal.SIGVTALRM, SimpleNamespace(f_code=code))
    assert asked == [3.0, plugin.SOON_S]
    assert not plugin.too_long
    with pytest.raises(pytest.skip.Exception):
        end(signal.SIGVTALRM, SimpleNamespace(f_code=end.__code__))
    assert plugin.too_long == {"a.py::test_a"}
    limited.close()
