"""Command lines of the documentation: those of fenced blocks whole, those between backticks in part."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests import REPOSITORY

PAGES = tuple(  # without the history of the program
    sorted(
        page
        for page in (*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md"))
        if page.name.lower() != "changelog.md"
    )
)
# What only says how, or as whom, the next word is run.
WRAPPERS = {"sudo": 0, "env": 0, "-u": 1, "taskset": 2, "chrt": 2, "do": 0}
_FENCED = re.compile(r"^( *)```([^\n]*)\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
_ASSIGNED = re.compile(r"[A-Z_][A-Z0-9_]*=.*")


@dataclass(frozen=True)
class ShellCommand:
    """A command: its page, its program without folder and wrappers, and the words after it."""

    page: str
    program: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page}: {shlex.join((self.program, *self.words))}"

    @property
    def module(self) -> str:
        """Module after `-m` of Python, "" where there is none."""
        python = self.program.startswith("python") and self.words[:1] == ("-m",)
        return self.words[1] if python else ""


@dataclass(frozen=True)
class Block:
    """A fenced block: its page, its language, and its text."""

    page: str
    language: str
    text: str

    def commands(self) -> Iterator[ShellCommand]:
        """Yield the commands of all lines."""
        for line in self.text.replace("\\\n", " ").splitlines():
            yield from commands_of(self.page, line)


def blocks() -> list[Block]:
    """Return the fenced blocks of all pages."""
    return [
        Block(_name(page), found[2].strip(), found[3])
        for page in PAGES
        for found in _FENCED.finditer(page.read_text("utf-8"))
    ]


def fragments() -> list[ShellCommand]:
    """Return what is between backticks in a text and begins with one of our programs."""
    found = []
    for page in PAGES:
        text = _FENCED.sub("", page.read_text("utf-8"))
        for code in re.findall(r"`((?:\.venv/bin/)?(?:slz|make|python3?) [^`]+)`", text):
            found += commands_of(_name(page), " ".join(code.split()))
    return found


def commands_of(page: str, line: str) -> Iterator[ShellCommand]:
    """Yield the commands of a line: parts of a pipe or a loop are commands of their own."""
    try:
        words = shlex.split(re.sub(r"\$\([^)]*\)", "...", line), comments=True)
    except ValueError:  # a picture with an apostrophe
        return
    part: list[str] = []
    for word in [*words, ";"]:
        if word not in (";", "&", "&&", "|") and not word.endswith(";"):
            part.append(word)
            continue
        command = _unwrapped(part + ([word.rstrip(";")] if word != ";" and word.endswith(";") else []))
        if command:
            yield ShellCommand(page, Path(command[0]).name, tuple(command[1:]))
        part = []


def _unwrapped(words: list[str]) -> list[str]:
    """Return a command without assignments before it and without wrappers."""
    rest = list(words)
    while rest:
        if _ASSIGNED.fullmatch(rest[0]):
            del rest[0]
        elif rest[0] in WRAPPERS:
            del rest[: 1 + WRAPPERS[rest[0]]]
        else:
            break
    is_command = bool(rest) and rest[0] not in ("for", "done") and not rest[0].endswith("/")
    return rest if is_command else []


def _name(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()
