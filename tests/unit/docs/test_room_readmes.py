"""READMEs of the rooms, and CONTRIBUTING.md: present, short, and every path that they name exists."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests import REPOSITORY

HOUSES = "slz", "companion/flight", "companion/desk", "sitl", "tests"
HEADINGS = "In and out", "Read first", "What must stay true", "To change", "Tests"
MOST_LINES = 45
SUFFIXES = "html|j2|json|md|parm|params|py|sh|toml"
ROOTS = "companion/", "deploy/", "docs/", "params/", "sitl/", "slz/", "tests/"
MADE_BY_RUNS = "evidence.html", "evidence.json", "evidence.md", "flight.json", "index.html", "scene.json"
_PATH = re.compile(rf"[\w.*-]+(?:/[\w.*-]+)*/|[\w.*-]+(?:/[\w.*-]+)+|[\w*-]+(?:\.[\w*]+)*\.(?:{SUFFIXES})")


@cache
def tracked() -> frozenset[Path]:
    """Return the files of the repository that are not ignored, and their folders."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=REPOSITORY, check=True, capture_output=True, text=True).stdout
    files = {REPOSITORY / name for name in names.splitlines() if (REPOSITORY / name).exists()}
    return frozenset(files | {folder for file in files for folder in file.parents})


def rooms() -> list[Path]:
    """Return the five houses and the folders directly inside them."""
    houses = [REPOSITORY / house for house in HOUSES]
    folders = {path for path in tracked() if path.is_dir() and path.parent in houses}
    return [*houses, *sorted(folders)]


PAGES = [*(room / "README.md" for room in rooms()), REPOSITORY / "CONTRIBUTING.md"]


def named_paths(text: str) -> Iterator[str]:
    """Yield the paths in backticks and links, and those of the repository in commands in backticks."""
    for code in re.findall(r"`([^`\n]+)`", text):
        words = code.split()
        if len(words) == 1 and _PATH.fullmatch(code):
            yield code
        elif len(words) > 1:
            yield from (word for word in words if word.startswith(ROOTS))
    yield from (link for link in re.findall(r"\]\(([^)#]+)[^)]*\)", text) if "://" not in link)


def exists(path: str, folder: Path) -> bool:
    """Return whether a path is found from its page's folder or the root, or a bare name anywhere.

    `NAME` and `*` stand for any part of a name.
    """
    pattern = path.replace("NAME", "*").rstrip("/")
    if any(found in tracked() for base in (folder, REPOSITORY) for found in base.glob(pattern)):
        return True
    return "/" not in path and any(file.match(pattern) for file in tracked())


@pytest.mark.parametrize("room", rooms(), ids=lambda room: room.relative_to(REPOSITORY).as_posix())
def test_a_room_has_a_readme_of_one_screen_with_the_headings(room: Path) -> None:
    text = (room / "README.md").read_text("utf-8")
    assert text.startswith(f"# {room.relative_to(REPOSITORY).as_posix()}: ")
    assert tuple(re.findall(r"^## (.+)$", text, re.MULTILINE)) == HEADINGS
    assert len(text.splitlines()) <= MOST_LINES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPOSITORY).as_posix())
def test_every_path_named_exists(page: Path) -> None:
    named = [path for path in named_paths(page.read_text("utf-8")) if path not in MADE_BY_RUNS]
    assert named
    assert [path for path in named if not exists(path, page.parent)] == []


def test_a_path_that_is_missing_is_found_out() -> None:
    text = (
        "`zones/lost.py`, `lost.py`, `.venv/bin/python -m pytest slz/lost`, [x](lost.md), `zones/*.py`, `m/s`"
    )
    missing = [path for path in named_paths(text) if not exists(path, REPOSITORY / "slz")]
    assert missing == ["zones/lost.py", "lost.py", "slz/lost", "m/s", "lost.md"]
