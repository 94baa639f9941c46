"""`slz map` of the shared clouds, with its maps, and `slz nearest` on the result."""

from __future__ import annotations

from pathlib import Path

import laspy

from tests.answers.program import slz
from tests.answers.recorder import Recorder
from tests.answers.shared import DATA, absent

VELODYNE = "velodyne_vlp16/1673400472138016708.pcd"
CASES: dict[str, tuple[str, list[str]]] = {
    "autzen": ("autzen_trim.laz", ["--classified"]),
    "autzen_tiles": ("autzen_trim.laz", ["--tile-m", "60"]),
    "autzen_source": ("autzen_trim.laz", ["--set", "mode=source", "--cell-m", "1"]),
    "lake": ("lake_crop.laz", ["--cell-m", "1"]),
    "lake_helicopter": ("lake_crop.laz", ["--profile", "helicopter"]),
    "lake_unclassified": ("lake_crop.laz", ["--cell-m", "1"]),
    "velodyne": (VELODYNE, ["--crs", "EPSG:32633", "--cell-m", "1", "--max-slope-deg", "20"]),
}
AUTZEN_LAT_LON = ("44.0550", "-123.0700")


def record(recorder: Recorder) -> None:
    """Record summary and files of each case."""
    for name, (file, options) in CASES.items():
        cloud = DATA / file
        if line := absent(cloud):
            recorder.skip(f"{name}: {line}")
            continue
        out = recorder.work / name
        # A copy: paths in the answers must not depend on where the shared folder is.
        copy = recorder.work / cloud.name
        if name.endswith("_unclassified"):
            _unclassify(cloud, copy)
        else:
            copy.write_bytes(cloud.read_bytes())
        summary = slz(["map", copy.name, "--out", name, *options], recorder.work, codes=(0, 1, 2))
        recorder.add(f"{name}/summary", summary)
        recorder.add_folder(f"{name}/files", out)
        if name == "autzen":
            nearest = ["nearest", *AUTZEN_LAT_LON, "--survey", name]
            recorder.add(f"{name}/nearest", slz(nearest, recorder.work))


def _unclassify(cloud: Path, copy: Path) -> None:
    """Copy a cloud with all points unclassified, as a sensor in flight sees them: water is ground."""
    points = laspy.read(cloud)
    points.classification[:] = 1
    points.write(copy)
