"""`slz reproduce`: the sources' scenes and tables, with ours beside them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from companion import folder
from companion.errors import UsageError
from companion.figures import save_maps
from companion.reproduce import page
from companion.reproduce.planes import slope_errors
from companion.reproduce.scenes import CASES, Outcome
from companion.reproduce.scenes import run as run_case

__all__ = ["run"]


def run(out: Path, progress: Callable[[str, float], None], only: str = "") -> dict[str, Any]:
    """Run every case, write the page and its pictures, and return the figures for JSON.

    Flown surveys are kept in `out/surveys` and used again.

    Parameters
    ----------
    only
        Cases whose name holds this text; all when empty.

    Raises
    ------
    UsageError
        The folder cannot be written, or no case is called so.
    """
    cases = [case for case in CASES if only in case.name]
    if not cases:
        raise UsageError(f"--only {only!r}: there are {', '.join(case.name for case in CASES)}")
    outcomes: list[Outcome] = []
    pictures: list[tuple[str, list[Path]]] = []
    folder.prepare(out)
    try:
        progress("planes", 0.0)
        errors = slope_errors()
        for number, case in enumerate(cases):
            progress(case.name, number / len(cases))
            outcome, _ = run_case(case, out / "surveys")
            drawn = save_maps(
                out / case.name.replace(" ", "_").replace(",", ""),
                outcome.maps,
                outcome.report.zones,
                outcome.parameters,
            )
            outcomes.append(outcome)
            pictures.append((case.name, list(drawn)))
        tables = [page.scene_table(outcomes), page.slope_table(errors)]
        files = page.write(out, tables, pictures)
    except OSError as error:
        raise UsageError(f"--out {out}: cannot be written: {error}") from None
    progress("done", 1.0)
    return {
        "files": [str(file) for file in files],
        "scenes": {o.case.name: _figures(o) for o in outcomes},
        "slope_rms_deg": {f"{e.slope_deg:g}": [e.gradient_rms_deg, e.plane_rms_deg] for e in errors},
    }


def _figures(outcome: Outcome) -> dict[str, Any]:
    s = outcome.scores
    return {
        "area_error": round(s.area_error, 5),
        "area_error_limit": outcome.case.area_error_limit,
        "computed_m2": round(s.computed_m2, 1),
        "truth_m2": round(s.truth_m2, 1),
        "unsafe_as_safe": s.false_safe,
        "recall": round(s.recall, 5),
        "zones": len(outcome.report.zones),
        "ms_median": round(outcome.ms_median, 1),
        "ms_max": round(outcome.ms_max, 1),
    }
