"""Surveys of stored clouds (`slz map`): options, refusals, and the run.

The run is imported when it is called for: `slz nearest` and refusals load no kernels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.desk.survey.atomic_folder import check_output_path
from companion.desk.survey.tiled.task_engine import Engine, InProcess, engine
from companion.runtime.errors import UsageError
from params import Parameters

if TYPE_CHECKING:
    from companion.desk.survey.map_run import run

__all__ = ["MapOptions", "engine", "run"]


def __getattr__(name: str) -> Any:
    if name != "run":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from companion.desk.survey.map_run import run

    return run


@dataclass(frozen=True, slots=True)
class MapOptions:
    """Options of a survey besides files and parameters.

    crs overrides the CRS of the files, and gives that of formats that state none. classified: also write
    the points with their classes. tile_m: side of a tile, which changes no result. engine: executor of the
    tasks. vertical_unit: unit of the heights (m, ft, us-ft), which overrides the files. corridors: also judge
    the ways in to and out of each zone's landing point.
    """

    crs: str | None = None
    classified: bool = False
    tile_m: float | None = None
    engine: Engine = InProcess()  # noqa: RUF009 - it has no state
    vertical_unit: str | None = None
    corridors: bool = False

    def check(self, out: Path, parameters: Parameters) -> None:
        """Refuse an output path that is a file, and options that no survey can have together.

        Raises
        ------
        UsageError
            The path, an option, or its combination with `mode=source` cannot be used.
        """
        check_output_path(out)
        if self.tile_m is not None and not (math.isfinite(self.tile_m) and self.tile_m > 0):
            raise UsageError(f"--tile-m {self.tile_m:g}: a length in metres, such as 512")
        if parameters.mode != "source":
            return
        if self.corridors:
            raise UsageError("--corridors: mode=source judges no ways in and out: leave one of both out")
        if self.tile_m is not None or not isinstance(self.engine, InProcess):
            raise UsageError(
                "mode=source maps one window in one piece: leave --tile-m, --workers, --scheduler out"
            )
