"""`slz map`: from files to zones, maps and pictures."""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from companion import figures
from companion.errors import UsageError
from companion.interrupt import Interrupted
from companion.survey import raster, zones
from companion.survey.classified import write_classified
from companion.survey.cloud import read
from companion.survey.kml import write_kml
from companion.survey.reference import from_option
from companion.survey.summary import summary
from companion.survey.survey import survey
from params import Parameters

log = logging.getLogger(__name__)

Progress = Callable[[str, float], None]


def run(
    files: Sequence[Path],
    out: Path,
    parameters: Parameters,
    progress: Progress,
    crs: str | None = None,
    classified: bool = False,
) -> dict[str, Any]:
    """Survey clouds, write zones, GeoTIFF and pictures, and return the summary for JSON.

    The folder gets all results at the end, or none.

    Parameters
    ----------
    files
        Clouds of one CRS, see `companion.survey.kind`.
    out
        Folder, made where there is none.
    parameters
        `coverage_m` and `max_zones` follow the cloud where nobody set them.
    progress
        Called with what is done next and the share that is done.
    crs
        Overrides the CRS of the files, and names that of files that cannot.
    classified
        Write the points with their classes, too.

    Raises
    ------
    UsageError
        A file, the CRS, the folder or the size of the grid cannot be used.
    """
    started = time.perf_counter()
    _look(out)
    progress("reading", 0.0)
    cloud = read(files, crs, lambda share: progress("reading", 0.5 * share))
    progress("mapping", 0.5)
    found = survey(cloud, parameters)
    progress("writing", 0.65)
    described = zones.rows(found.report.zones, found.maps, found.metric)
    try:
        with _unfinished(out) as folder:
            outputs = raster.write(folder, found.maps, found.metric, found.parameters.mode == "source")
            outputs.append(folder / "zones.geojson")
            zones.write_geojson(outputs[-1], found.report.zones, described, found.maps, found.metric)
            outputs.append(folder / "zones.kml")
            write_kml(outputs[-1], found.report.zones, described, found.maps, found.metric)
            if classified:
                progress("classifying", 0.75)
                given = from_option(crs) if crs else None
                outputs += write_classified(folder, files, given, found.maps, found.metric)
            progress("drawing", 0.8)
            outputs += figures.save_maps(folder, found.maps, found.report.zones, found.parameters)
            outputs = _finish(outputs, out)
    except OSError as error:
        raise UsageError(f"--out {out}: cannot be written: {error}") from None
    progress("done", 1.0)
    told = summary(files, cloud, found, described, outputs)
    for warning in told["warnings"]:
        log.warning(warning)
    return told | {"seconds": round(time.perf_counter() - started, 3)}


@contextmanager
def _unfinished(out: Path) -> Iterator[Path]:
    """Make a folder within `out` for results that are not yet whole; nothing of it is left behind."""
    made = [part for part in (out, *out.parents) if not part.exists()]
    out.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(prefix=".slz-map-", dir=out, ignore_cleanup_errors=True) as folder:
            yield Path(folder)
    finally:
        for part in made:
            with suppress(OSError):  # results lie in it
                part.rmdir()


def _finish(written: list[Path], out: Path) -> list[Path]:
    """Move whole results to where they belong, all of them, whatever signal comes; return where they are."""
    try:
        for path in written:
            path.replace(out / path.name)
    except Interrupted:
        for path in written:
            if path.exists():
                path.replace(out / path.name)
        raise
    return [out / path.name for path in written]


def _look(out: Path) -> None:
    """Refuse a folder that is a file before minutes are spent; it is made when something is written."""
    for part in (out, *out.parents):
        if part.exists():
            if not part.is_dir():
                raise UsageError(f"--out {out}: {part} is a file: name a folder")
            return
