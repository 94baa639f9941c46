"""The report of a sample of mutants."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.mutation.trial import SURVIVED


def written(results: Sequence[Mapping[str, object]], file: Path, goal: float) -> int:
    """Write killed and sampled by file, and every survivor; return 0 where the goal is reached, else 1."""
    sampled = Counter(str(r["mutant"]).partition(":")[0] for r in results)
    survivors = [r for r in results if r["outcome"] == SURVIVED]
    living = Counter(str(r["mutant"]).partition(":")[0] for r in survivors)
    killed = len(results) - len(survivors)
    share = killed / max(len(results), 1)
    lines = [f"{killed} of {len(results)} mutants killed, {share:.1%}; the goal is {goal:.0%}.", ""]
    lines += ["| file | killed | sampled |", "|---|---|---|"]
    lines += [f"| {path} | {n - living[path]} | {n} |" for path, n in sorted(sampled.items())]
    lines += ["", "Survivors, with the line as it was changed:", ""]
    lines += [f"- {r['mutant']} ({r['tests']} tests): `{r['line']}`" for r in survivors]
    file.write_text("\n".join(lines) + "\n")
    print(lines[0], f"Report: {file}")
    return 0 if share >= goal else 1
