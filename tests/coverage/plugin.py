"""Pytest plugin that records lines and cost of each test, and ends tests beyond their time limit.

Without the compiler a flight of seconds takes minutes. A test that exceeds its processor time is skipped
and named; the lines it reached still count. Its result is checked in the compiled run.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Generator
from pathlib import Path
from types import FrameType

import coverage
import pytest

TRACER = Path(coverage.__file__).parent
SOON_S = 0.01

costs_s: dict[str, float] = {}
too_long: set[str] = set()  # functions of which a case took too long; the others are not tried


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the caller name the limit and the file of costs."""
    parser.addoption(
        "--processor-limit",
        type=float,
        default=0.0,
        metavar="SECONDS",
        help="skip a test that takes longer; 0: never",
    )
    parser.addoption(
        "--costs",
        type=Path,
        default=None,
        metavar="FILE",
        help="write the processor time of each test that passed",
    )


def _limited(item: pytest.Item) -> Generator[None, object, object]:
    limit: float = item.config.getoption("--processor-limit")
    function = item.nodeid.partition("[")[0]
    if function in too_long:
        pytest.skip("another case took too long")

    def end(_signal: int, frame: FrameType | None) -> None:
        if frame is not None and Path(frame.f_code.co_filename).is_relative_to(TRACER):
            signal.setitimer(signal.ITIMER_VIRTUAL, SOON_S)  # it may hold a lock that nobody would release
            return
        too_long.add(function)
        pytest.skip(f"more than {limit:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Name the test to coverage, where it measures."""
    if measured := coverage.Coverage.current():
        measured.switch_context(item.nodeid)
    try:
        return (yield)
    finally:
        if measured:
            measured.switch_context("")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Limit what a test prepares."""
    return (yield from _limited(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Limit the test itself, and note what it cost if it passed."""
    began_s = time.process_time()
    result = yield from _limited(item)
    costs_s[item.nodeid] = time.process_time() - began_s
    return result


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the costs."""
    path: Path | None = session.config.getoption("--costs")
    if path:
        path.write_text(json.dumps(costs_s, indent=0))
