"""Fuzz campaign: millions of inputs in one process; keeps failures.

`python -m tests.fuzz.campaign --inputs 100000`
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import ctypes
import gc
import hashlib
import json
import logging
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random

from companion.runtime.program_version import program_version
from tests.fuzz import files, texts, wire
from tests.fuzz.harness import Harness, Target, limited
from tests.fuzz.mutation import mutated

ALL: dict[str, Harness] = {h.name: h for h in (*wire.HARNESSES, *texts.HARNESSES, *files.HARNESSES)}
FOUND = Path(__file__).parent / "found"
MEND_SHARE = 0.7
GROWN_MB = 48.0
MOST_FAILURES = 20
PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(slots=True)
class Outcome:
    """What became of a harness's inputs.

    Attributes
    ----------
    failed
        How many of the inputs raised; those that a failure is made small with are none of them.
    failures
        Where each defect is kept and what it raised, by its signature.
    """

    name: str
    inputs: int = 0
    failed: int = 0
    seconds: float = 0.0
    grown_mb: float = 0.0
    failures: dict[str, str] = field(default_factory=dict)

    @property
    def grew(self) -> bool:
        return self.grown_mb >= GROWN_MB

    @property
    def ok(self) -> bool:
        return not self.failures and not self.grew


def signature(error: BaseException) -> str:
    """Return what tells one defect from another: the error and the place in this project."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if "site-packages" not in f.filename and "tests/fuzz" not in f.filename]
    where = f"{Path(ours[-1].filename).name}:{ours[-1].name}" if ours else "?"
    return f"{type(error).__name__} in {where}"


def tried(harness: Harness, target: Target, data: bytes) -> BaseException | None:
    """Return what an input raised, None if all is well."""
    try:
        with limited(harness.limit_s):
            target(data)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        return error
    return None


def replayed(harness: Harness, inputs: Sequence[bytes], folder: Path) -> str:
    """Return the signature of what inputs raise on a new target, one after the other; empty for nothing."""
    target = harness.make(folder)
    for data in inputs:
        error = tried(harness, target, data)
        if error is not None:
            return signature(error)
    return ""


def smallest(harness: Harness, inputs: list[bytes], told: str, folder: Path, tries: int = 400) -> list[bytes]:
    """Return fewer and shorter inputs that raise the same."""
    if replayed(harness, inputs[-1:], folder) == told:
        inputs = inputs[-1:]
    step = max(len(inputs) // 2, max(map(len, inputs)) // 2)
    while step and tries > 0:
        changed = False
        for k in range(len(inputs) - 2, -1, -1):
            fewer = inputs[:k] + inputs[k + 1 :]
            if tries > 0 and replayed(harness, fewer, folder) == told:
                inputs, changed = fewer, True
            tries -= 1
        at = 0
        while at < len(inputs[-1]) and tries > 0:
            shorter = [*inputs[:-1], inputs[-1][:at] + inputs[-1][at + step :]]
            tries -= 1
            if replayed(harness, shorter, folder) == told:
                inputs, changed = shorter, True
            else:
                at += step
        step = step if changed and step > 1 else step // 2
    return inputs


def run(
    harness: Harness,
    count: int,
    seed: int,
    folder: Path,
    keep: Path | None,
    gauge: Callable[[], float] | None = None,
) -> Outcome:
    """Try so many inputs; each run with a seed tries the same ones.

    gauge: memory in use (MB), by default this process's, which a full collection goes before.
    """
    gauge = gauge or resident_mb
    rng, corpus = Random(f"{harness.name} {seed}"), list(harness.corpus())
    outcome, start = Outcome(harness.name), time.process_time()
    target, past = harness.make(folder), []
    settled = max(1, count // 10)
    base_mb = 0.0
    while outcome.inputs < count and len(outcome.failures) < MOST_FAILURES:
        if len(past) >= harness.renew:
            target, past = harness.make(folder), []
        data = mutated(rng.choice(corpus), corpus, harness.words, rng)
        if rng.random() < MEND_SHARE:
            data = harness.mend(data, rng)
        past.append(data)
        outcome.inputs += 1
        error = tried(harness, target, data)
        if error is not None:
            outcome.failed += 1
            told = signature(error)
            if told not in outcome.failures:
                outcome.failures[told] = _kept(harness, past, told, error, folder, keep)
            target, past = harness.make(folder), []
        if outcome.inputs == settled:
            base_mb = gauge()
    outcome.seconds = time.process_time() - start
    outcome.grown_mb = gauge() - base_mb
    return outcome


def _kept(
    harness: Harness, past: list[bytes], told: str, error: BaseException, folder: Path, keep: Path | None
) -> str:
    """Write a failure down with its smallest inputs; return where, and what was raised."""
    inputs = smallest(harness, past, told, folder) if replayed(harness, past, folder) == told else past
    text = f"{type(error).__name__}: {error}"[:200]
    if keep is None:
        return text
    document = {
        "harness": harness.name,
        "was": f"{told}: {text}",
        "inputs": [base64.b64encode(d).decode() for d in inputs],
    }
    name = hashlib.sha256(b"|".join(inputs)).hexdigest()[:10]
    keep.mkdir(parents=True, exist_ok=True)
    path = keep / f"{harness.name}-{name}.json"
    path.write_text(json.dumps(document, indent=1) + "\n")
    return f"{text} ({path})"


def resident_mb() -> float:
    """Return this process's memory, without what it could give back."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):  # of another C library than Debian's
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 2**20


def document(outcomes: Sequence[Outcome], seed: int, program: str) -> dict[str, object]:
    """Return the results as a document for `slz evidence`."""
    harnesses = [
        asdict(o) | {"ok": o.ok, "grew": o.grew, "failures": [*o.failures.values()]} for o in outcomes
    ]
    return {"format": "slz-fuzz", "version": 1, "program": program, "seed": seed, "harnesses": harnesses}


def main() -> int:
    """Run the harnesses, cheap ones with more inputs, and print what came of each."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.campaign", description=__doc__)
    parser.add_argument("--inputs", type=int, default=100_000, help="in all harnesses together")
    parser.add_argument("--only", default="", help="names of harnesses, with commas")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file for the results as JSON")
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="folder for what fails")
    options = parser.parse_args()
    chosen = [ALL[name] for name in options.only.split(",")] if options.only else list(ALL.values())
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("error")
    shares = sum(1 / h.cost for h in chosen)
    outcomes: list[Outcome] = []
    program = program_version()
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        print(
            f"inputs that are files lie in {folder}, also when a library ends this process", file=sys.stderr
        )
        for harness in chosen:
            count = max(1, round(options.inputs / harness.cost / shares))
            outcome = run(harness, count, options.seed, Path(folder), options.keep)
            outcomes.append(outcome)
            pace = outcome.inputs / max(outcome.seconds, 1e-9)
            state = "ok" if outcome.ok else "FAILED"
            told = f"{outcome.inputs:9d} inputs {pace:8.0f}/s {outcome.grown_mb:+7.1f} MB {state}"
            print(f"{harness.name:18} {told}", flush=True)
            for what, text in outcome.failures.items():
                print(f"    {what}: {text}", flush=True)
    total, seconds = sum(o.inputs for o in outcomes), sum(o.seconds for o in outcomes)
    failed, defects = sum(o.failed for o in outcomes), sum(len(o.failures) for o in outcomes)
    print(f"{total} inputs in {seconds:.0f} s, {failed} failed, {defects} defects")
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(document(outcomes, options.seed, program)) + "\n", "utf-8")
    return 0 if all(o.ok for o in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
