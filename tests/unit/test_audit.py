"""Distinction of an audit that could not run from one that passed."""

from __future__ import annotations

from typing import Any

from tests.audit import DID_NOT_RUN, verdict

KNOWN = {"id": "CVE-1", "fix_versions": ["3.0"]}
CANARY = {"name": "django", "version": "2.2.0", "vulns": [KNOWN]}
CLEAN = {"name": "numpy", "version": "2.4.6", "vulns": []}
SKIPPED = {"name": "numpy", "skip_reason": "not found"}


def answer(*packages: dict[str, Any]) -> dict[str, Any]:
    return {"dependencies": list(packages)}


def test_no_answer_says_that_it_did_not_run() -> None:
    assert verdict(None, "no route") == (f"{DID_NOT_RUN}: no route", 0)


def test_an_index_that_skips_all_or_knows_no_fault_of_the_canary_says_that_it_did_not_run() -> None:
    for document in (answer(SKIPPED, CANARY), answer(CLEAN, {**CANARY, "vulns": []}), answer(CLEAN)):
        text, code = verdict(document, "")
        assert text.startswith(DID_NOT_RUN)
        assert code == 0


def test_known_vulnerabilities_are_named_and_fail() -> None:
    text, code = verdict(answer(CANARY, {**CLEAN, "vulns": [KNOWN]}), "")
    assert text.splitlines() == [
        "dependency audit: 1 packages, 1 known vulnerabilities",
        "numpy 2.4.6: CVE-1 (mended in 3.0)",
    ]
    assert code == 1


def test_a_clean_audit_says_how_many_were_asked_and_which_were_not() -> None:
    other = {"name": "mine", "skip_reason": "not found"}
    assert verdict(answer(CANARY, CLEAN, other), "") == (
        "dependency audit: 1 packages, 0 known vulnerabilities; not audited: mine",
        0,
    )
