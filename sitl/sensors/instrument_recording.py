"""Command line of the instrument recorders: `--seed N --out FILE.npz`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path


def run(record: Callable[[int, Path], None]) -> None:
    """Record with the options of the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    record(options.seed, options.out)
