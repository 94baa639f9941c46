"""Flights of the fault campaign and of the landing benchmark: a line of JSON each."""

from __future__ import annotations

from collections.abc import Callable

from companion.desk.evidence.artefact_fields import ArtefactError, Fields, RepeatedKeyError
from companion.desk.evidence.evidence_runs import UNKNOWN_VERSION, Runs, one

CAMPAIGN, LANDINGS = "campaign", "landings"
TOUCHDOWNS, COLLISIONS, COMMANDS = "touchdowns", "collisions", "commands"
NOBODY = ""  # nobody but the companion brought it down


def kind_of_flight(line: Fields) -> str:
    """Return the kind of log that a line belongs to, "" for none."""
    if {"number", "fault", "state", "landed_by"} <= line.values.keys():
        return CAMPAIGN
    return LANDINGS if {"number", "taken_over_in", "hazard_arrived"} <= line.values.keys() else ""


def read_flights(name: str, text: str, kind: str) -> tuple[list[Runs], list[str]]:
    """Return the runs of a log, and notes about it; a last line cut short by a stop is left out.

    Raises
    ------
    ArtefactError
        A line is no flight of the kind.
    """
    reader: Callable[[Fields], list[Runs]] = _campaign if kind == CAMPAIGN else _landing
    runs, notes = [], []
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if not line.strip():
            continue
        try:
            fields = Fields.parse(f"{name}, line {k + 1}", line)
        except RepeatedKeyError:
            raise
        except ArtefactError:
            if k < len(lines) - 1 or text.endswith("\n"):
                raise
            notes.append("the last line is cut off and left out")
            break
        if kind_of_flight(fields) != kind:
            raise ArtefactError(f"--artefact {fields.where}: no flight of {kind}")
        runs += reader(fields)
    return runs, notes


def _campaign(line: Fields) -> list[Runs]:
    """Return the runs of a flight; one that does not record its judgement is of an unknown version."""
    judged = isinstance(line.values.get("not_as_stated"), list)
    program = line.text("program", UNKNOWN_VERSION) if judged else UNKNOWN_VERSION
    wrong = [str(each) for each in line.values.get("not_as_stated") or ()]
    companions = line.text("landed_by") == NOBODY
    touched = line.values.get("touchdown") is not None
    unsafe_ground = touched and companions and not line.flag("safe")
    collided = companions and line.values.get("collision") is not None
    return _flight(line, CAMPAIGN, line.text("fault"), program, wrong,
                   touched=touched and companions, unsafe_ground=unsafe_ground, collided=collided,
                   happened=line.values.get("began_s") is not None)  # fmt: skip


def _landing(line: Fields) -> list[Runs]:
    """Return the runs of a flight; one that does not record its kind is of an unknown version."""
    program = line.text("program", UNKNOWN_VERSION) if "kind" in line.values else UNKNOWN_VERSION
    # A flight with an error of the flight's script is not `landed`, but it may have touched down.
    touched, collided = line.values.get("error_m") is not None, line.values.get("collision") is not None
    unsafe_ground = touched and not line.flag("safe")
    crossing = line.values.get("crossing")
    late = isinstance(crossing, dict) and bool(crossing.get("late"))
    failure = line.text("failure", "")
    wrong = [failure] * bool(failure) + ["no order in time before what crossed"] * late
    happened = line.text("hazards", "none") == "none" or line.flag("hazard_arrived")
    return _flight(line, LANDINGS, line.text("kind", "unknown"), program, wrong, touched=touched,
                   unsafe_ground=unsafe_ground, collided=collided, happened=happened)  # fmt: skip


def _flight(line: Fields, kind: str, variant: str, program: str, wrong: list[str], *, touched: bool,
            unsafe_ground: bool, collided: bool, happened: bool) -> list[Runs]:  # fmt: skip
    number = line.count("number")
    commands = line.count("commands_while_pilot_flies", 0)
    bad = ["touched unsafe ground"] * unsafe_ground + ["collided"] * collided
    bad += [f"{commands} commands against the pilot or a failsafe"] * (commands > 0)
    what = "; ".join(dict.fromkeys([*bad, *wrong]))[:200]
    failed = bool(what)
    label = kind if kind == CAMPAIGN else f"{kind} {variant}"

    def runs(source: str, name: str, failures: bool, unsafe: bool, skipped: bool) -> Runs:
        said = f"{label} {number}: {what}" if failures else ""
        return Runs(
            source, name, one(number), program, 1, int(failures), int(unsafe), int(skipped), what=said
        )

    found = [runs(kind, variant, failed, bool(bad), skipped=not happened and not failed)]
    found.append(runs(COLLISIONS, label, collided, collided, skipped=False))
    found.append(runs(COMMANDS, label, commands > 0, commands > 0, skipped=False))
    if touched:
        found.append(runs(TOUCHDOWNS, label, unsafe_ground, unsafe_ground, skipped=False))
    return found
