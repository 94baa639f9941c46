"""`slz --version`: versions of the program and of what its numbers depend on."""

from __future__ import annotations

import platform
from importlib.metadata import version

import typer


def describe() -> str:
    """Return the versions of slz, Python, Numba and NumPy, and the platform, in one line."""
    python = platform.python_version()
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numba", "numpy"))
    return f"slz {version('slz')}, Python {python}, {libraries}, {platform.platform()}"


def show(asked: bool) -> None:
    """Print the versions and end, when the option is given."""
    if asked:
        print(describe())
        raise typer.Exit
