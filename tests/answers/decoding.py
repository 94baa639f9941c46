"""Files that the program writes, decoded into trees."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import rasterio
from PIL import Image

from tests.answers.page import sections
from tests.answers.reports import plain
from tests.answers.tree import Tree

DATED = ("TIFFTAG_DATETIME", "TIFFTAG_SOFTWARE")
"""TIFF tags that hold a date or a version."""
DATED_TEXTS = ("Software", "Creation Time", "date:create", "date:modify")
"""Texts in a PNG that hold a date or a version."""


def decoded(path: Path) -> Tree:
    """Return what a file holds: its values and metadata, without dates and versions of libraries.

    A file of another kind is its lines where it is text, else its bytes.
    """
    return DECODERS.get(path.suffix.lower(), _plain)(path)


def decoded_folder(folder: Path) -> dict[str, Tree]:
    """Return every file below a folder, by its path."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): decoded(path) for path in files}


def _json(path: Path) -> Tree:
    return json.loads(path.read_text("utf-8"))


def _plain(path: Path) -> Tree:
    data = path.read_bytes()
    try:
        return data.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        return np.frombuffer(data, np.uint8)


def _npz(path: Path) -> Tree:
    """Return digests of the arrays: flown surveys hold a gigabyte."""
    with np.load(path, allow_pickle=False) as file:
        return {name: plain(file[name]) for name in file.files}


def _tiff(path: Path) -> Tree:
    with rasterio.open(path) as file:
        tags = {key: value for key, value in file.tags().items() if key not in DATED}
        bands = {
            str(k): {
                "cells": file.read(k),
                "tags": file.tags(k),
                "description": file.descriptions[k - 1],
                "unit": file.units[k - 1],
                "overviews": list(file.overviews(k)),
                "colours": {str(n): list(c) for n, c in _colours(file, k).items()},
            }
            for k in file.indexes
        }
        return {
            "crs": file.crs.to_wkt() if file.crs else None,
            "transform": list(file.transform),
            "nodata": file.nodata,
            "block_shapes": [list(shape) for shape in file.block_shapes],
            "compression": str(file.compression),
            "tags": tags,
            "bands": bands,
        }


def _colours(file: rasterio.DatasetReader, band: int) -> dict[int, tuple[int, ...]]:
    try:
        return dict(file.colormap(band))
    except ValueError:  # none
        return {}


def _png(path: Path) -> Tree:
    with Image.open(path) as picture:
        texts = {key: str(value) for key, value in picture.info.items() if key not in DATED_TEXTS}
        return {"pixels": np.asarray(picture), "info": texts}


def _las(path: Path) -> Tree:
    with laspy.open(path) as reader:
        header, points = reader.header, reader.read()
    crs = header.parse_crs()
    return {
        "version": str(header.version),
        "format": header.point_format.id,
        "scales": list(header.scales),
        "offsets": list(header.offsets),
        "global_encoding": header.global_encoding.value,
        "crs": crs.to_wkt() if crs else None,
        "records": [[v.user_id, v.record_id, v.description] for v in header.vlrs],
        "dimensions": {name: np.asarray(points[name]) for name in points.point_format.dimension_names},
    }


DECODERS: dict[str, Callable[[Path], Tree]] = {
    ".json": _json,
    ".md": lambda path: sections(path.read_text("utf-8")),
    ".npz": _npz,
    ".geojson": _json,
    ".tif": _tiff,
    ".png": _png,
    ".las": _las,
    ".laz": _las,
}
