"""`slz sim`: the simulated vehicle alone."""

from __future__ import annotations

import os
import sys

import typer

from companion.cli.console import err
from companion.runtime import kernel_compilation


def sim(context: typer.Context) -> None:
    """Run the simulated vehicle alone: `slz sim --help` shows its options."""
    if "--help" not in context.args and kernel_compilation.is_first(kernel_compilation.of_simulator()):
        err.print("first start: compiling the simulator for this computer, a minute, once", highlight=False)
    os.execv(sys.executable, [sys.executable, "-m", "sitl", *context.args])
