"""`slz doctor` as a program: examine, show, say whether all is well."""

from __future__ import annotations

import asyncio
from typing import Any

from rich.table import Table

from companion.flight.doctor.examination import Examination
from companion.flight.doctor.finding import Finding, healthy
from companion.flight.link.wire.signing import Signing
from params import Parameters

_STYLE = {"ok": "green", "warn": "yellow", "fail": "bold red", "skipped": "dim"}


def examine(
    mavlink_url: str,
    lidar_url: str,
    parameters: Parameters,
    seconds: float,
    signing: Signing | None = None,
    system: int | None = None,
) -> list[Finding]:
    """Listen for so many seconds and return the findings; raises UsageError for a URL that is none."""
    return asyncio.run(Examination(mavlink_url, lidar_url, parameters, seconds, signing, system).run())


def document(findings: list[Finding]) -> dict[str, Any]:
    """Return what `--json` prints."""
    return {"ok": healthy(findings), "findings": [finding.document() for finding in findings]}


def table(findings: list[Finding]) -> Table:
    """Return the findings for a person, each with what to do."""
    shown = Table("check", "", "found", "needed", "what to do")
    for finding in findings:
        state = f"[{_STYLE[finding.state]}]{finding.state}[/]"
        shown.add_row(finding.check, state, finding.found, finding.needed, finding.remedy)
    return shown
