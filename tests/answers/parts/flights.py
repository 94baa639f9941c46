"""Ten seeded flights of `slz demo`: answers, maps, reports of the pipeline, datagrams of both sides."""

from __future__ import annotations

from tests.answers import flown
from tests.answers.program import slz
from tests.answers.recorder import Recorder

QUICK = ("--headless", "--point-rate", "25000", "--limit-s", "200")
FLIGHTS: dict[str, list[str]] = {
    "stadium": ["--scene", "stadium", "--seed", "1"],
    "plain": ["--scene", "plain", "--seed", "2"],
    "hill_helicopter": ["--scene", "hill", "--seed", "3", "--profile", "helicopter"],
    "streets": ["--scene", "streets", "--seed", "4"],
    "mountains": ["--scene", "mountains", "--seed", "5"],
    "dense": ["--scene", "dense", "--seed", "6"],
    "dust_out": ["--scene", "dust_out", "--seed", "7"],
    "plain_intruder": ["--scene", "plain", "--seed", "8", "--intruder", "car@15"],
    "stadium_flash": ["--scene", "stadium", "--seed", "9", "--sensor", "flash"],
    "stadium_radar": ["--scene", "stadium", "--seed", "10", "--sensor", "lidar+radar"],
}


def record(recorder: Recorder) -> None:
    """Record every flight."""
    for name, options in FLIGHTS.items():
        probe = recorder.work / f"{name}_probe"
        probe.mkdir()
        out = recorder.work / name
        answer = slz(["demo", *options, *QUICK, "--out", str(out)], recorder.work, codes=(0, 1), probe=probe)
        recorder.add(f"{name}/answer", answer)
        recorder.add(f"{name}/reports", flown.reports(probe))
        recorder.add(f"{name}/wire", flown.streams(probe))
        recorder.add_folder(f"{name}/files", out)
