"""Result of one check of the doctor."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

State = Literal["ok", "warn", "fail", "skipped"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A check with its result.

    state: 'fail' for a fault that keeps the system from working, 'warn' for one that degrades it, 'skipped'
    for a check that another finding made impossible. remedy: action to take, empty if none is needed.
    """

    check: str
    state: State
    found: str
    needed: str = ""
    remedy: str = ""

    def document(self) -> dict[str, Any]:
        """Return the finding as `--json` prints it."""
        return asdict(self)


def judged(
    check: str, good: bool, found: str, needed: str, remedy: str, *, otherwise: State = "fail"
) -> Finding:
    """Return an 'ok' finding if `good`, else one in state `otherwise` with the remedy."""
    return Finding(check, "ok" if good else otherwise, found, needed, "" if good else remedy)


def healthy(findings: list[Finding]) -> bool:
    """Return whether no finding failed."""
    return all(finding.state != "fail" for finding in findings)
