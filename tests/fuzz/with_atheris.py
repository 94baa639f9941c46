"""`python -m tests.fuzz.with_atheris HARNESS -atheris_runs=N`: one harness, guided by coverage.

Needs the extra `fuzz` (atheris has wheels for x86-64 only). Further words are libFuzzer's.
"""

from __future__ import annotations

import logging
import os
import sys
import tempfile
from pathlib import Path
from random import Random

import atheris

os.environ["NUMBA_DISABLE_JIT"] = "1"  # Numba cannot read what atheris makes of a function
with atheris.instrument_imports(include=["companion", "params"]):
    from tests.fuzz.campaign import ALL
    from tests.fuzz.harness import Harness


class Tried:
    """Calls a harness's target as libFuzzer wants it, with and without mended checksums in turn."""

    def __init__(self, harness: Harness, folder: Path) -> None:
        self._harness, self._folder = harness, folder
        self._target, self._taken = harness.make(folder), 0

    def __call__(self, data: bytes) -> None:
        self._taken += 1
        if self._taken % self._harness.renew == 0:
            self._target = self._harness.make(self._folder)
        if data[:1] < b"\x80":  # the input itself decides, so that it does the same each time
            data = self._harness.mend(data, Random(len(data)))
        self._target(data)


def main() -> None:
    """Fuzz the harness that is named."""
    name, words = sys.argv[1], sys.argv[2:]
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder) / "corpus"
        corpus.mkdir()
        for number, data in enumerate(ALL[name].corpus()):
            (corpus / str(number)).write_bytes(data)
        limits = ["-timeout=5", "-rss_limit_mb=3000", "-max_len=4096"]
        atheris.Setup([sys.argv[0], *words, *limits, str(corpus)], Tried(ALL[name], Path(folder)))
        atheris.Fuzz()


if __name__ == "__main__":
    main()
