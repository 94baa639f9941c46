"""`slz sim`: the simulated vehicle alone."""

from __future__ import annotations

import os
import sys

import typer


def sim(context: typer.Context) -> None:
    """Run the simulated vehicle alone: `slz sim --help` shows its options."""
    os.execv(sys.executable, [sys.executable, "-m", "sitl", *context.args])
