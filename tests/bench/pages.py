"""Pages of docs/benchmark: which are older than the code they measure, and their commands again.

python -m tests.bench.pages [--run [PAGE ...]]

A page states the commit at which it was measured (`Commit `1234abc``), else it is as old as its last change,
or older; and in its first block the commands that made it. `--run` runs the commands of the named pages, or
of all that are older, and writes what they print to out/benchmark/PAGE.txt. A command that needs something
from outside, such as an autopilot, is left out.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests import REPOSITORY

PAGES = REPOSITORY / "docs" / "benchmark"
OUT = Path("out/benchmark")
METHOD = ("slz", "params")
# Code that a page measures; the tests that measure it belong to it.
MEASURED = {
    "accuracy": (*METHOD, "companion/desk/reproduce", "sitl"),
    "arm": ("slz/kernels", "tests/bench/instructions.py"),
    "autopilots": ("companion/flight", "slz", "params"),
    "flash-lidar": ("slz/flash", "slz/kernels/instruments"),
    "flights": (*METHOD, "companion/flight", "sitl"),
    "link-and-streams": ("companion/flight/link", "companion/flight/outputs", "companion/flight/recorder"),
    "moving": ("slz/moving", "slz/kernels", "tests/bench/moving.py"),
    "pilot-page": ("companion/flight/dashboard", "tests/bench/test_page.py"),
    "radar": ("slz/radar", "slz/kernels/instruments"),
    "robustness": ("companion", "slz", "tests/fuzz", "tests/campaign"),
    "safe-maps": (*METHOD, "companion/desk/open_benchmark"),
    "second-opinion": ("sitl", "tests/opinion"),
    "source-mode": ("slz/paper", "slz/kernels/paper", "tests/bench/compare.py"),
    "specks": ("slz/airborne", "slz/kernels/points", "tests/bench/specks.py"),
    "speed": (*METHOD, "companion", "sitl", "tests/bench/speed.py"),
    "surface": ("slz/surface", "slz/kernels/surface", "tests/bench/surfaces.py"),
    "surveys": (*METHOD, "companion/desk/survey", "tests/bench/surveys.py"),
    "wires": ("slz/wires", "slz/kernels/lines", "tests/bench/wires.py"),
}
STATED = re.compile(r"[Cc]ommit `([0-9a-f]{7,40})(-dirty)?`")
FROM_OUTSIDE = re.compile(r"\b(PATH|[NSX]|baseline\.cpp|gen\.py|flight\.mcap|tcp:\S+|\S+\.json)\b")


@dataclass(frozen=True)
class Page:
    """A page, the commit that it states or that changed it last, and later commits to what it measures."""

    name: str
    commit: str
    is_stated: bool
    n_later: int

    def __str__(self) -> str:
        age = (
            f"older by {'' if self.is_stated else 'at least '}{self.n_later} commits"
            if self.n_later
            else "of now"
        )
        return f"{self.name:<18} {self.commit:<9} {age}{'' if self.is_stated else ', states no commit'}"


def pages() -> list[Page]:
    """Return the pages in order; the index has no figures of its own."""
    return [_page(path) for path in sorted(PAGES.glob("*.md")) if path.name != "index.md"]


def _page(path: Path) -> Page:
    stated = STATED.search(path.read_text("utf-8"))
    commit = stated[1] if stated else _git("log", "-1", "--format=%h", "--", str(path))
    n_later = _git("rev-list", "--count", f"{commit}..HEAD", "--", *MEASURED[path.stem])
    return Page(path.stem, commit, stated is not None, int(n_later))


def _git(*command: str) -> str:
    own = ["git", "-C", str(REPOSITORY), *command]
    return subprocess.run(own, check=True, capture_output=True, text=True).stdout.strip()


def commands(text: str) -> list[str]:
    """Return the commands in the first block of a page, without their remarks."""
    _, _, rest = text.partition("```\n")
    lines = (line.partition("  #")[0].strip() for line in rest.partition("```")[0].splitlines())
    return [line for line in lines if line]


def run(name: str) -> None:
    """Run the commands of a page, each word of `slz` and `python` from this environment."""
    out, own = OUT / f"{name}.txt", Path(sys.executable).parent
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open("w") as file:
        for command in commands((PAGES / f"{name}.md").read_text("utf-8")):
            command = re.sub(r" \[[^]]* [NSX]\]", "", command)  # an option with a number to choose
            if needed := FROM_OUTSIDE.search(command):
                print(f"left out, it needs {needed[0]}: {command}", file=sys.stderr)
                continue
            said = command.replace("DIR", str(OUT / name)).replace("[", "").replace("]", "")
            print(f"{name}: {said}", file=sys.stderr)
            path = {"PATH": f"{own}:/usr/local/bin:/usr/bin:/bin"}
            subprocess.run(said, shell=True, stdout=file, cwd=REPOSITORY, env=path, check=False)


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--run", nargs="*", metavar="PAGE", help="none: all that are older")
    args = ask.parse_args()
    found = pages()
    print(*found, sep="\n")
    if args.run is not None:
        for name in args.run or [page.name for page in found if page.n_later]:
            run(name)


if __name__ == "__main__":
    main()
