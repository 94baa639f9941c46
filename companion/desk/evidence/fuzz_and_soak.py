"""Results of the fuzz campaign and of the soak: a JSON document each."""

from __future__ import annotations

from dataclasses import replace

from companion.desk.evidence.artefact_fields import Fields
from companion.desk.evidence.evidence_runs import UNKNOWN_VERSION, Runs, one
from companion.desk.evidence.flight_results import TOUCHDOWNS

FUZZ, SOAK = "fuzz", "soak"
FUZZ_FORMAT = "slz-fuzz"


def is_soak(document: Fields) -> bool:
    """Return whether a document is a soak's verdict."""
    return {"hours", "reports", "rss_growth", "failed"} <= document.values.keys()


def read_fuzz(document: Fields) -> list[Runs]:
    """Return the inputs of each harness: the same seed gives the same inputs, a longer run more of them."""
    program, seed = document.text("program", UNKNOWN_VERSION), document.count("seed")
    found = []
    for k, each in enumerate(document.items("harnesses")):
        harness = Fields(f"{document.where}, harness {k + 1}", each if isinstance(each, dict) else {})
        name, inputs = harness.text("name"), harness.count("inputs")
        failures = harness.items("failures")
        if not harness.flag("ok") and not failures:
            failures = ["memory grew"]
        what = f"{name}, seed {seed}: {failures[0]}"[:200] if failures else ""
        found.append(Runs(FUZZ, name, one(seed), program, inputs, min(len(failures), inputs), what=what))
    return found


def read_soak(document: Fields) -> list[Runs]:
    """Return the soak as one run, and its landings: of one seed, one after the other, not independent."""
    program = document.text("program", UNKNOWN_VERSION)
    clock = document.text("clock", "unknown")
    seed = document.count("seed", 0)
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
