"""One thing looked at, and what came of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

State = Literal["ok", "warn", "fail", "skipped"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A check with its result.

    state: 'fail' is what the system does not work with, 'warn' what it works less well with, 'skipped' what
    could not be looked at because of another finding. remedy: what to do, empty when there is nothing.
    """

    check: str
    state: State
    found: str
    needed: str = ""
    remedy: str = ""

    def document(self) -> dict[str, Any]:
        """Return it as `--json` prints it."""
        return asdict(self)


def judged(
    check: str, good: bool, found: str, needed: str, remedy: str, *, otherwise: State = "fail"
) -> Finding:
    """Return a finding that is fine, or that is `otherwise` and has a remedy."""
    return Finding(check, "ok" if good else otherwise, found, needed, "" if good else remedy)


def healthy(findings: list[Finding]) -> bool:
    """Tell whether nothing needed is wrong."""
    return all(finding.state != "fail" for finding in findings)
