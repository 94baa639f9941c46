"""Robustness of every parser: seeded inputs, and every failure ever found (`make fuzz` tries more)."""

from __future__ import annotations

import base64
import json
import logging
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.desk.evidence.artefact_file import read_artefact
from tests.fuzz.campaign import ALL, FOUND, Outcome, document, replayed, run
from tests.fuzz.harness import HangError, Harness, limited
from tests.unit.companion.flight.sensors.ouster_packets import MISSING

# What decoding one packet costs beyond its share here; the campaign tries these too.
COSTLY = {"radar": 4, "flash": 4, "ouster-metadata": 10, "crs": 2}
INPUTS = 60


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Log nothing: what is refused is not news here."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.parametrize("name", list(ALL))
def test_changed_inputs_are_taken_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    """Growing memory is for the campaign: a few inputs show none, and every look costs half a second."""
    if MISSING and name.startswith("ouster"):
        pytest.skip(MISSING)
    outcome = run(ALL[name], COSTLY.get(name, INPUTS), 1, tmp_path, None, lambda: 0.0)
    assert outcome.failures == {}


@pytest.mark.parametrize("name", ["mavlink", "livox", "order", "request", "setting", "pcd", "tlog"])
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=600), seed=st.randoms(use_true_random=False))
def test_inputs_of_any_bytes_are_taken_or_refused_in_one_line(
    name: str, data: bytes, seed: object, tmp_path: Path
) -> None:
    harness = ALL[name]
    target = harness.make(tmp_path)
    target(data)
    target(harness.mend(data, seed))  # type: ignore[arg-type]


@pytest.mark.parametrize("path", sorted(FOUND.glob("*.json")), ids=lambda path: path.stem)
def test_what_was_found_stays_mended(path: Path, tmp_path: Path) -> None:
    case = json.loads(path.read_text("utf-8"))
    inputs = [base64.b64decode(data) for data in case["inputs"]]
    assert replayed(ALL[case["harness"]], inputs, tmp_path) == "", case["was"]


def test_a_defect_is_found_and_its_input_made_small(tmp_path: Path) -> None:
    def fragile(data: bytes) -> None:
        if b"\xff" in data:
            raise IndexError("a defect")

    harness = Harness("fragile", lambda: [bytes(64)], lambda _folder: fragile)
    outcome = run(harness, 500, 1, tmp_path, tmp_path)
    assert list(outcome.failures) == ["IndexError in ?"]
    case = json.loads(next(tmp_path.glob("fragile-*.json")).read_text("utf-8"))
    assert [base64.b64decode(data) for data in case["inputs"]] == [b"\xff"]


def test_the_results_are_an_artefact_of_evidence(tmp_path: Path) -> None:
    defect = Outcome("las", 10, failed=4, failures={"IndexError in las.py:x": "no"})
    both = Outcome("ply", 30, failed=2, grown_mb=99.0, failures={"KeyError in ply.py:x": "no"})
    outcomes = [Outcome("livox", 500), defect, Outcome("pcd", 20, grown_mb=99.0), both]
    path = tmp_path / "fuzz.json"
    path.write_text(json.dumps(document(outcomes, 7, "1+a")) + "\n", "utf-8")
    read = read_artefact(path)
    assert read.programs() == ["1+a"]
    found = [(r.variant, r.runs, r.failures, r.at_least) for r in read.runs]
    assert found == [
        ("livox", 500, 0, False),
        ("las", 10, 4, False),
        ("pcd", 20, 1, True),
        ("ply", 30, 2, True),
    ]


def test_an_endless_input_is_stopped() -> None:
    def endless() -> None:
        while True:
            pass

    with pytest.raises(HangError, match="longer than 0.05 s"), limited(0.05):
        endless()
