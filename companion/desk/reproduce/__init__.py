"""Reproduction of the sources' scenes and tables beside results of slz (`slz reproduce`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from companion.desk.figures import save_maps
from companion.desk.reproduce import (
    instrument_data,
    landing_points,
    near_far,
    odometry_section,
    reliability,
    reproduction_page,
    square_filter,
    surface_section,
    window_timing,
    zone_identities,
)
from companion.desk.reproduce.inclined_planes import slope_errors
from companion.desk.reproduce.near_far import CLIMBS
from companion.desk.reproduce.odometry_section import SURVEYS as DRIFTING
from companion.desk.reproduce.places import PLACES
from companion.desk.reproduce.reproduction_page import Section
from companion.desk.reproduce.scenarios import BY_SCENE, ENTRANCE, SCENARIOS
from companion.desk.reproduce.source_scenes import CASES, Case, CaseOutcome
from companion.desk.reproduce.source_scenes import run as run_case
from companion.desk.reproduce.surface_surveys import SURFACES
from companion.runtime import output_folder
from companion.runtime.errors import UsageError

__all__ = ["run"]

Progress = Callable[[str, float], None]
GROWING = (ENTRANCE, BY_SCENE["mountains"])


def run(out: Path, progress: Progress, only: str = "") -> dict[str, Any]:
    """Run every case and section, write the page and its pictures, and return the figures for JSON.

    Flown surveys are cached in `out/surveys`.

    Parameters
    ----------
    only
        Text that the names of cases, scenarios, surveys ("surface of lakes", "odometry over stadium, severe
        drift") and instruments (flash, radar) must contain; empty for all.

    Raises
    ------
    UsageError
        The folder cannot be written, or no name contains the text.
    """
    cases = [case for case in CASES if only in case.name]
    surveys = [*(survey.name for survey in SURFACES), *(survey.name for survey in DRIFTING)]
    others = [*surveys, *instrument_data.NAMES]
    if not cases and not any(only in name for name in others):
        names = [*(case.name for case in CASES), *others]
        raise UsageError(f"--only {only!r}: there are {', '.join(names)}")
    output_folder.prepare(out)
    try:
        sections = _sections(out, cases, only, progress)
        files = reproduction_page.write(out, sections)
    except OSError as error:
        raise UsageError(f"--out {out}: cannot be written: {error}") from None
    progress("done", 1.0)
    figures: dict[str, Any] = {"files": [str(file) for file in files]}
    for section in sections:
        figures |= section.figures
    return figures


def _sections(out: Path, cases: Sequence[Case], only: str, progress: Progress) -> list[Section]:
    """Return the page's sections in order; each is the result of a module's function `section`."""
    surveys = out / "surveys"
    rooms = [scenario for scenario in SCENARIOS if only in scenario.name]
    growing = [scenario for scenario in GROWING if only in scenario.name]
    places = [place for place in PLACES if only in place.name]
    climbs = [climb for climb in CLIMBS if only in climb.name]
    grounds = [survey for survey in SURFACES if only in survey.name]
    drifting = [survey for survey in DRIFTING if only in survey.name]
    devices = [name for name in instrument_data.NAMES if only in name]
    once = len(cases) + len(growing) + len(grounds) + len(drifting) + len(devices)
    done, steps = 0, bool(cases) + once + 2 * (len(rooms) + len(places) + len(climbs))

    def step(name: str) -> None:
        nonlocal done
        progress(name, done / steps)
        done += 1

    def others() -> list[Section]:
        surfaces = [surface_section.section(grounds, out / "surface", surveys, step)] if grounds else []
        odometry = [odometry_section.section(drifting, out / "odometry", surveys, step)] if drifting else []
        return [*surfaces, *odometry, *instrument_data.sections(devices, out, step)]

    if not cases:
        return others()
    outcomes: list[CaseOutcome] = []
    certainties: dict[str, reliability.Bins] = {}
    for case in cases:
        step(case.name)
        outcome, recording = run_case(case, surveys)
        outcomes.append(outcome)
        if outcome.parameters.mode == "default":
            certainties[case.name] = reliability.count(recording, outcome.maps)
    against_truth = _against_truth(outcomes, out)
    step("planes")
    errors = slope_errors()
    slopes = {f"{e.slope_deg:g}": [e.gradient_rms_deg, e.plane_rms_deg] for e in errors}
    return [
        against_truth,
        Section([reproduction_page.slope_table(errors)], [], {"slope_rms_deg": slopes}),
        *([square_filter.section(rooms, out, surveys, step)] if rooms else []),
        *([zone_identities.section(growing, out, surveys, step)] if growing else []),
        *([near_far.section(climbs, out, surveys, step)] if climbs else []),
        *([reliability.section(certainties, out)] if certainties else []),
        *([landing_points.section(places, out, surveys, step)] if places else []),
        window_timing.section(outcomes, out),
        *others(),
    ]


def _against_truth(outcomes: Sequence[CaseOutcome], out: Path) -> Section:
    """Return the section of the area errors, SLZ paper, Eq. (20), and the maps of every case."""
    pictures = [
        (o.case.name, save_maps(out / o.case.folder, o.maps, o.report.zones, o.parameters)) for o in outcomes
    ]
    figures = {"scenes": {o.case.name: _figures(o) for o in outcomes}}
    return Section([reproduction_page.scene_table(outcomes)], pictures, figures)


def _figures(outcome: CaseOutcome) -> dict[str, Any]:
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
        "ms_p99": round(outcome.ms_p99, 1),
        "ms_max": round(outcome.ms_max, 1),
    }
