"""Options of a survey, and refusals before any kernel is loaded."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from companion.desk.survey.atomic_folder import check_output_path
from companion.desk.survey.tiled.task_engine import Engine, InProcess
from companion.runtime.errors import UsageError
from params import Parameters


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
