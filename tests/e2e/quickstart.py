"""Commands of docs/quickstart.md, verbatim."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "quickstart.md").read_text("utf-8")


@dataclass(frozen=True)
class Command:
    """A line of a block: environment variables before it, and its words."""

    environment: dict[str, str]
    words: tuple[str, ...]

    @property
    def program(self) -> str:
        return Path(self.words[0]).name

    def value(self, option: str) -> str:
        """Return what follows an option."""
        return self.words[self.words.index(option) + 1]

    def values(self, option: str) -> list[str]:
        """Return what follows an option each time that it is given."""
        return [after for word, after in zip(self.words, self.words[1:], strict=False) if word == option]


def blocks() -> list[list[Command]]:
    """Return the commands of each fenced block."""
    fenced = re.findall(r"^```\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return [[_command(line) for line in text.replace("\\\n", " ").splitlines()] for text in fenced]


def block_with(words: str) -> list[Command]:
    """Return the one block in which a command holds these words."""
    (found,) = [block for block in blocks() if any(words in " ".join(command.words) for command in block)]
    return found


def slz(block: list[Command], command: str) -> Command:
    """Return the one `slz COMMAND` of a block."""
    (found,) = [c for c in block if c.program == "slz" and c.words[1] == command]
    return found


def replaced(words: tuple[str, ...], ports: dict[int, int]) -> list[str]:
    """Return words with other ports; each must occur."""
    text = "\n".join(words)
    for old, new in ports.items():
        assert f":{old}" in text, (old, words)
        text = text.replace(f":{old}", f":{new}")
    return text.split("\n")


def _command(line: str) -> Command:
    words = shlex.split(line.strip().removesuffix("&"))
    environment = {}
    while "=" in words[0]:
        name, _, value = words.pop(0).partition("=")
        environment[name] = value
    return Command(environment, tuple(words))
