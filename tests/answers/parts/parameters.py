"""Values, ranges and units of all parameters."""

from __future__ import annotations

from tests.answers.program import slz
from tests.answers.recorder import Recorder

PROFILES = ("quadcopter", "helicopter")
WORDS = ("description",)
"""Texts for people, which may be rewritten."""


def record(recorder: Recorder) -> None:
    """Record `slz params` of each profile."""
    for profile in PROFILES:
        table = slz(["params", "--profile", profile], recorder.work)
        del table["exit_code"]
        rows = {
            name: {key: value for key, value in row.items() if key not in WORDS}
            for name, row in table.items()
        }
        recorder.add(profile, rows)
