"""Autopilot parameter files, as a ground station loads them."""

from __future__ import annotations

from importlib import resources

from params.load import ParameterError

AUTOPILOT_FILES = (
    "arducopter.parm",
    "arducopter_odometry.parm",
    "px4.params",
    "px4_odometry.params",
    "px4_sih.params",
)


def autopilot_file(name: str) -> tuple[str, str]:
    """Return file name and text of a parameter file by its name, with or without the ending.

    Raises
    ------
    ParameterError
        There is no such file.
    """
    for file in AUTOPILOT_FILES:
        if name in (file, file.partition(".")[0]):
            return file, resources.files("params").joinpath("autopilot", file).read_text("utf-8")
    known = ", ".join(file.partition(".")[0] for file in AUTOPILOT_FILES)
    raise ParameterError(f"no parameter file {name!r}: there are {known}")
