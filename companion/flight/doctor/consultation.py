"""Front end of `slz doctor`: run the examination, format the findings."""

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
    """Listen for `seconds` and return the findings; raise UsageError for a wrong URL."""
    return asyncio.run(Examination(mavlink_url, lidar_url, parameters, seconds, signing, system).run())


def document(findings: list[Finding]) -> dict[str, Any]:
    """Return the document that `--json` prints."""
    return {"ok": healthy(findings), "findings": [finding.document() for finding in findings]}


def table(findings: list[Finding]) -> Table:
    """Return the findings as a table, each with its remedy."""
    shown = Table("check", "", "found", "needed", "what to do")
    for finding in findings:
        state = f"[{_STYLE[finding.state]}]{finding.state}[/]"
        shown.add_row(finding.check, state, finding.found, finding.needed, finding.remedy)
    return shown
