"""Audit of pinned packages for known vulnerabilities with pip-audit (`make audit`).

Exit code 0: none is known, or the audit could not run, which one line reports; 1: some are known.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
# Its faults are known to every database: one that does not tell them tells nothing of the others either.
CANARY = "django==2.2.0"
DID_NOT_RUN = "dependency audit DID NOT RUN"
LIMIT_S = 300


def verdict(document: dict[str, Any] | None, why: str) -> tuple[str, int]:
    """Return what to say and the exit code.

    Parameters
    ----------
    document
        pip-audit's JSON, None where it gave none.
    why
        The last line of what it said besides.
    """
    if document is None:
        return f"{DID_NOT_RUN}: {why or 'pip-audit said nothing'}", 0
    canary, _ = CANARY.split("==")
    found = {p["name"].lower(): p for p in document["dependencies"]}
    packages = [p for name, p in found.items() if name != canary]
    asked = [p for p in packages if "skip_reason" not in p]
    if not asked or not found.get(canary, {}).get("vulns"):
        return f"{DID_NOT_RUN}: the package index here knows no vulnerabilities, not even of {CANARY}", 0
    bad = [
        f"{p['name']} {p['version']}: {v['id']} (mended in {', '.join(v['fix_versions']) or 'no version'})"
        for p in asked
        for v in p["vulns"]
    ]
    left = sorted(p["name"] for p in packages if "skip_reason" in p)
    text = f"dependency audit: {len(asked)} packages, {len(bad)} known vulnerabilities"
    text += f"; not audited: {', '.join(left)}" if left else ""
    return "\n".join([text, *bad]), 1 if bad else 0


def ask(pins: str) -> tuple[dict[str, Any] | None, str]:
    """Return pip-audit's answer, and the last line that it said."""
    with tempfile.TemporaryDirectory() as folder:
        listed, out = Path(folder) / "pins.txt", Path(folder) / "audit.json"
        listed.write_text(f"{pins}\n{CANARY}\n", "utf-8")
        words = ["--no-deps", "--disable-pip", "--progress-spinner", "off", "--timeout", "10"]
        command = [sys.executable, "-m", "pip_audit", "-r", str(listed), "-f", "json", "-o", str(out), *words]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        except subprocess.TimeoutExpired:
            return None, f"no answer within {LIMIT_S} s"
        lines = done.stderr.strip().splitlines()
        document = json.loads(out.read_text("utf-8")) if out.exists() else None
        return document, lines[-1].split("(Caused by")[0][:200] if lines else ""


def main() -> int:
    """Audit what constraints.txt pins."""
    text, code = verdict(*ask((ROOT / "constraints.txt").read_text("utf-8")))
    print(text)
    return code


if __name__ == "__main__":
    sys.exit(main())
