"""Results of the fuzz campaign and of the soak: a JSON document each."""

from __future__ import annotations

from dataclasses import replace

from companion.desk.evidence.artefact_fields import Fields
from companion.desk.evidence.evidence_runs import UNKNOWN_VERSION, Runs, one
from companion.desk.evidence.flight_results import TOUCHDOWNS

FUZZ, SOAK = "fuzz", "soak"
FUZZ_FORMAT, FUZZ_VERSION = "slz-fuzz", 1


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
