"""Runs of the fault campaign and the landing benchmark, a line of JSON each, of fuzzing and of soaks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from companion.desk.evidence.artefact_fields import ArtefactError, Fields, NoJsonError
from companion.desk.evidence.evidence_ledger import UNKNOWN_VERSION, Runs, one

FUZZ, SOAK = "fuzz", "soak"
FUZZ_FORMAT, FUZZ_VERSION = "slz-fuzz", 1

CAMPAIGN, LANDINGS = "campaign", "landings"
TOUCHDOWNS, COLLISIONS, COMMANDS, BY_OTHERS = "touchdowns", "collisions", "commands", "by_others"
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
        except NoJsonError:
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
    judgement = line.values.get("not_as_stated")
    judged = isinstance(judgement, list)
    program = line.text("program", UNKNOWN_VERSION) if judged else UNKNOWN_VERSION
    wrong = [str(each) for each in judgement] if isinstance(judgement, list) else []
    touched, collided = line.values.get("touchdown") is not None, line.values.get("collision") is not None
    unsafe_ground = touched and not line.flag("safe")
    happened = line.values.get("began_s") is not None
    return _flight(line, CAMPAIGN, line.text("fault"), program, wrong, touched=touched,
                   unsafe_ground=unsafe_ground, collided=collided, happened=happened,
                   landed_by=line.text("landed_by"))  # fmt: skip


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
            unsafe_ground: bool, collided: bool, happened: bool,
            landed_by: str = NOBODY) -> list[Runs]:  # fmt: skip
    """Return the flight and its measures; ends under the pilot or a failsafe are a measure of their own."""
    number = line.seed("number")
    commands = line.count("commands_while_pilot_flies", 0)
    bad_end = ["touched unsafe ground"] * unsafe_ground + ["collided"] * collided
    bad = bad_end if landed_by == NOBODY else []
    against = [f"{commands} commands against the pilot or a failsafe"] * (commands > 0)
    what = "; ".join(dict.fromkeys([*bad, *against, *wrong]))[:200]
    label = kind if kind == CAMPAIGN else f"{kind} {variant}"
    said = f"{label} {number}: {what}" if what else ""
    run = Runs(kind, variant, one(number), program, failures=int(bool(what)), what=said,
               unsafe=int(bool(bad or against)), skipped=int(not happened and not what))  # fmt: skip

    def measure(source: str, failed: bool, failure: str) -> Runs:
        said = f"{label} {number}: {failure}" if failed else ""
        return Runs(source, label, run.seeds, program, failures=int(failed), unsafe=int(failed), what=said)

    found = [run, measure(COMMANDS, commands > 0, what)]
    if landed_by != NOBODY:
        ending = f"{'; '.join(bad_end)} ({landed_by})"
        return [*found, measure(BY_OTHERS, bool(bad_end), ending)]
    found.append(measure(COLLISIONS, collided, what))
    if touched:
        found.append(measure(TOUCHDOWNS, unsafe_ground, what))
    return found


def is_soak(document: Fields) -> bool:
    """Return whether a document is a soak's verdict."""
    return {"hours", "reports", "rss_growth", "failed"} <= document.values.keys()


def read_fuzz(document: Fields) -> list[Runs]:
    """Return the inputs of each harness: the same seed gives the same inputs, a longer run more of them.

    `failures` are the different exceptions, `failed` the number of inputs that raised one. Without `failed`
    there are at least as many as exceptions; memory that grew is a failure of the run, of at least one input.

    Raises
    ------
    ArtefactError
        A field is missing or impossible.
    """
    document.version(FUZZ_VERSION)
    program, seed = document.text("program", UNKNOWN_VERSION), document.seed("seed")
    found = []
    for k, each in enumerate(document.items("harnesses")):
        harness = Fields(f"{document.where}, harness {k + 1}", each if isinstance(each, dict) else {})
        name, inputs = harness.text("name"), harness.count("inputs")
        raised = harness.items("failures")
        is_told = "failed" in harness.values
        failed = harness.count("failed", len(raised))
        most = inputs if raised else 0
        if is_told and not len(raised) <= failed <= most:
            raise harness.bad("failed", f"a number from {len(raised)} to {most}, by 'failures' and 'inputs',")
        grew = harness.flag("grew") or not (harness.flag("ok") or raised)
        said = [*raised[:1], *["memory grew"] * grew]
        what = f"{name}, seed {seed}: {'; '.join(map(str, said))}"[:200] if said else ""
        at_least = grew or (bool(raised) and not is_told)
        failures = max(failed, int(grew))
        found.append(Runs(FUZZ, name, one(seed), program, inputs, failures, what=what, at_least=at_least))
    return found


def read_soak(document: Fields) -> list[Runs]:
    """Return the soak as one run, and its landings: of one seed, one after the other, not independent."""
    program = document.text("program", UNKNOWN_VERSION)
    clock = document.text("clock", "unknown")
    seed = document.seed("seed", 0)
    grown = [str(each) for each in document.items("failed")]
    what = f"{clock} soak: {', '.join(grown)} did not stay" if grown else ""
    found = [Runs(SOAK, clock, one(seed), program, 1, int(bool(grown)), is_random=False, what=what)]
    if "came_of" in document.values:
        ends = document.part("came_of")
        safe, unsafe = ends.count("safe", 0), ends.count("unsafe", 0)
        said = f"{clock} soak: {unsafe} landings on unsafe ground" if unsafe else ""
        landings = Runs(TOUCHDOWNS, f"soak {clock}", one(seed), program, safe + unsafe, unsafe, unsafe)
        found.append(replace(landings, is_random=False, what=said))
    return found
