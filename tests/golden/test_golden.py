"""Golden values: small flights, frames and passes give the same numbers as before.

Correctness is for other tests; these detect unintended changes. `python -m tests.golden` accepts an
intended change.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.golden.fingerprint import differences, fingerprint
from tests.golden.flights import KEPT

FILE = Path(__file__).with_name("golden.json")
RTOL = 2e-6  # compiled and not, and another processor, round single precision in other ways


@pytest.mark.parametrize("name", KEPT)
def test_every_number_is_the_one_it_was(name: str) -> None:
    kept = json.loads(FILE.read_text())[name]
    for k, thing in enumerate(KEPT[name]()):
        assert differences(kept[k], fingerprint(thing), RTOL) == [], f"thing {k}"
    assert len(kept) == k + 1
