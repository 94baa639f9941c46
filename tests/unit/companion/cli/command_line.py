"""Command line in the process of the test: exit codes and refusals."""

from __future__ import annotations

import sys

import pytest

from companion.cli import program

RUN = ["run", "--mavlink", "udpin:127.0.0.1:0", "--lidar", "livox:127.0.0.1:0"]
Capture = pytest.CaptureFixture[str]


def ended(*words: str) -> int:
    """Run the command line and return its exit code."""
    sys.argv[1:] = words
    with pytest.raises(SystemExit) as left:
        program.main()
    return int(left.value.code or 0)


def refusal(capfd: Capture, *words: str) -> str:
    """Run the command line, which must end with exit code 2 and one line on stderr; return the line."""
    assert ended(*words) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("slz: ")
    assert err.count("\n") == 1
    return err
