"""Figures and pictures of `slz reproduce`."""

from __future__ import annotations

from tests.answers.program import slz
from tests.answers.recorder import Recorder


def record(recorder: Recorder) -> None:
    """Record the figures, the page and its pictures; the flown surveys only by their part in these."""
    recorder.add("figures", slz(["reproduce", "--out", "out"], recorder.work))
    recorder.add_folder("files", recorder.work / "out")
