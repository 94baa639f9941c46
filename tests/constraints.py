"""Check that constraints.txt is complete and installable for every supported Python (`make constraints`).

Asks pip for each Python and machine below, without installation, for the packages of `make setup`. Exit
code 0: everything is pinned and found, or no package index answered, which one line reports; 1: a package
is not pinned or not available.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
# Debian 12 and Raspberry Pi OS, Ubuntu 24.04, Debian 13, each with its C library (2.x).
PYTHONS = {"3.11.2": 36, "3.12": 39, "3.13": 41}
MACHINES = ("x86_64", "aarch64")
EXTRAS = ("survey", "page", "record", "plots", "ros", "dev", "docs")
# Installed without what they ask for (Makefile).
ALONE = ("MAVProxy", "ouster-sdk")
DID_NOT_RUN = "constraints check DID NOT RUN"
LIMIT_S = 600


def canonical(name: str) -> str:
    """Return a package's name as PEP 503 compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned(text: str) -> set[str]:
    """Return the names that a constraints file pins to one version."""
    return {canonical(line.split("==")[0]) for line in text.splitlines() if "==" in line}


def requirements(project: dict[str, Any]) -> list[str]:
    """Return what the project's table in pyproject.toml asks for: the program, its tools and its pages."""
    extras = project["optional-dependencies"]
    return [
        *project["dependencies"],
        *(one for extra in EXTRAS for one in extras[extra] if not one.startswith("slz[")),
    ]


def verdict(
    python: str, machine: str, report: dict[str, Any] | None, said: str, pins: set[str]
) -> tuple[str, int]:
    """Return what to say of one Python and machine, and the exit code.

    Parameters
    ----------
    report
        pip's installation report, None where it found no set of packages.
    said
        What pip said besides.
    pins
        Canonical names of what is pinned.
    """
    place = f"Python {python}, {machine}"
    if report is None:
        errors = [line for line in said.splitlines() if line.startswith("ERROR:")]
        if not errors or "Retrying" in said:
            return f"{DID_NOT_RUN}: {place}: no answer of a package index", 0
        return "\n".join([f"{place}: the pinned versions cannot be installed together", *errors]), 1
    names = {canonical(package["metadata"]["name"]) for package in report["install"]}
    if loose := sorted(names - pins):
        return f"{place}: not in constraints.txt: {', '.join(loose)}", 1
    return f"{place}: {len(names)} packages, all pinned", 0


def dry_run(python: str, machine: str, wanted: Sequence[str]) -> tuple[dict[str, Any] | None, str]:
    """Return pip's report of installing what is wanted on a Python and machine, and what pip said."""
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in range(PYTHONS[python], 4, -1)]
    platforms += [f"manylinux2014_{machine}", f"linux_{machine}"]
    tags = ["cp" + "".join(python.split(".")[:2]), "abi3", "none"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "report.json"
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed"]
        command += ["--python-version", python, "--implementation", "cp", "--only-binary", ":all:"]
        command += [word for tag in tags for word in ("--abi", tag)]
        command += [word for tag in platforms for word in ("--platform", tag)]
        command += ["--target", folder, "--report", str(out), "--constraint", str(ROOT / "constraints.txt")]
        try:
            done = subprocess.run(
                [*command, *wanted], capture_output=True, text=True, timeout=LIMIT_S, check=False
            )
        except subprocess.TimeoutExpired:
            return None, ""
        return (json.loads(out.read_text("utf-8")) if done.returncode == 0 else None), done.stderr


def ask(python: str, machine: str) -> tuple[dict[str, Any] | None, str]:
    """Return pip's report of all that `make setup` installs on a Python and machine, and what pip said."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    report, said = dry_run(python, machine, requirements(project))
    alone, said_of_them = dry_run(python, machine, ["--no-deps", *ALONE])
    if report is None or alone is None:
        return None, said + said_of_them
    return {"install": [*report["install"], *alone["install"]]}, ""


def main() -> int:
    """Ask for every Python and machine, two at a time."""
    pins = pinned((ROOT / "constraints.txt").read_text("utf-8"))
    places = [(python, machine) for python in PYTHONS for machine in MACHINES]
    with ThreadPoolExecutor(2) as pool:
        answers = pool.map(lambda place: ask(*place), places)
        verdicts = [verdict(*place, *answer, pins) for place, answer in zip(places, answers, strict=True)]
    print("\n".join(text for text, _ in verdicts))
    return max(code for _, code in verdicts)


if __name__ == "__main__":
    sys.exit(main())
