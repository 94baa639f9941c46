"""Existence of the tests that docs/sources.md names."""

from __future__ import annotations

import re

from tests import REPOSITORY

PAGE = (REPOSITORY / "docs" / "sources.md").read_text("utf-8")
HOME = "tests/unit/slz/test_departures.py"


def test_every_test_named_on_the_page_of_departures_exists() -> None:
    named = re.findall(r"`([\w/.]*)::(test_\w+)`", PAGE)
    assert len(named) > 20
    for file, test in named:
        assert f"def {test}(" in (REPOSITORY / (file or HOME)).read_text("utf-8"), f"{file}::{test}"


def test_every_row_of_departures_names_a_test() -> None:
    dangers = re.findall(r"^\| (\d+) \| (?!`[\w/.]*::)", PAGE, re.MULTILINE)
    tests = re.findall(r"^\| (\d+) \| `[\w/.]*::test_", PAGE, re.MULTILINE)
    assert dangers == tests == [str(row) for row in range(1, len(dangers) + 1)]


def test_every_gap_filled_names_a_test() -> None:
    bullets = PAGE.split("## Gaps and misprints filled")[1].split("\n- ")[1:]
    assert bullets
    assert all("::test_" in bullet for bullet in bullets)
