"""Survey run of `slz map`: from files to zones, maps and pictures."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from companion.desk import figures
from companion.desk.clouds.cloud import read
from companion.desk.survey import MapOptions, survey_files
from companion.desk.survey.atomic_folder import finish, locked_folder, temporary_folder, work_folder
from companion.desk.survey.cloud_survey import survey
from companion.desk.survey.findings import Findings, MapsInMemory, of_window
from companion.desk.survey.survey_corridors import check_reach
from companion.desk.survey.survey_summary import summary
from companion.desk.survey.tiled.task_engine import InProcess
from companion.desk.survey.tiled.tiled_survey import TiledSurvey, of_tiles, whole_maps
from companion.desk.survey.zone_table import rows
from companion.runtime.errors import UsageError
from params import Parameters

log = logging.getLogger(__name__)

Progress = Callable[[str, float], None]
MOST_DRAWN = 4_000_000  # cells up to which pictures are drawn; larger surveys have the page only
MOST_DRAWN_ZONES = 1000


def run(
    files: Sequence[Path],
    out: Path,
    parameters: Parameters,
    progress: Progress,
    plan: MapOptions = MapOptions(),  # noqa: B008 - it is frozen
) -> dict[str, Any]:
    """Survey clouds, write zones, GeoTIFF and pictures, and return the summary for JSON.

    The folder gets all results at the end, or none. An interrupted survey resumes when it is run again with
    the same arguments.

    Parameters
    ----------
    files
        Clouds of one CRS, see `companion.desk.clouds.cloud`.
    out
        Folder, made if it is missing.
    parameters
        `coverage_m` and `max_zones` are fitted to the cloud unless they were set.
    progress
        Called with the name of the next step and the share that is done.

    Raises
    ------
    UsageError
        A file, the CRS, the folder or the size of the grid cannot be used.
    """
    started = time.perf_counter()
    if not isinstance(plan.engine, InProcess):  # workers may have been started in another folder
        files, out = [path.absolute() for path in files], out.absolute()
    plan.check(out, parameters)
    if plan.corridors:
        check_reach(parameters)
    try:
        with locked_folder(out):
            if parameters.mode == "source":
                result = _in_one_window(files, out, parameters, progress, plan)
            else:
                result = _in_tiles(files, out, parameters, progress, plan)
    except OSError as error:
        raise UsageError(f"--out {out}: cannot be written: {error}") from None
    progress("done", 1.0)
    for warning in result["warnings"]:
        log.warning(warning)
    return result | {"seconds": round(time.perf_counter() - started, 3)}


def _in_tiles(
    files: Sequence[Path], out: Path, parameters: Parameters, progress: Progress, plan: MapOptions
) -> dict[str, Any]:
    with work_folder(out) as work:
        tiled = TiledSurvey(
            files,
            work,
            parameters,
            plan.engine,
            lambda *step: _scaled(progress, *step),
            plan.crs,
            plan.tile_m,
            plan.vertical_unit,
            plan.corridors,
        )
        return _written(files, out, of_tiles(tiled.run()), progress, plan)


def _in_one_window(
    files: Sequence[Path], out: Path, parameters: Parameters, progress: Progress, plan: MapOptions
) -> dict[str, Any]:
    """Survey by the sources' rules, which use windows and no tiles."""
    progress("reading", 0.0)
    cloud = read(files, plan.crs, lambda share: progress("reading", 0.5 * share), plan.vertical_unit)
    progress("mapping", 0.5)
    found = of_window(survey(cloud, parameters), cloud.n_read, cloud.coordinate_spacing)
    return _written(files, out, found, progress, plan)


def _scaled(progress: Progress, what: str, share: float) -> None:
    progress(what, 0.85 * share)


def _written(
    files: Sequence[Path], out: Path, found: Findings, progress: Progress, plan: MapOptions
) -> dict[str, Any]:
    described = rows(found)
    left_out = {one["file"] for one in found.skipped}
    with temporary_folder(out) as folder:
        progress("writing", 0.87)
        written = survey_files.rasters(folder, found)
        written += survey_files.zones(folder, files, found, described)
        if plan.classified:
            progress("classifying", 0.92)
            used = [path for path in files if str(path) not in left_out]
            written += survey_files.points(folder, used, found)
        rows_, cols = found.maps.grid.rows, found.maps.grid.cols
        if rows_ * cols <= MOST_DRAWN and len(found.zones) <= MOST_DRAWN_ZONES:
            progress("drawing", 0.95)
            maps = found.maps.maps if isinstance(found.maps, MapsInMemory) else whole_maps(found)
            written += figures.save_maps(folder, maps, found.zones, found.parameters)
        written = finish(written, out)
    return summary(files, found, described, written)
