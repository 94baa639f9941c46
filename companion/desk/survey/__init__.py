"""Surveys of stored clouds (`slz map`). Imports are lazy: `slz nearest` and refusals load no kernels."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from companion.desk.survey.map_options import MapOptions
    from companion.desk.survey.map_run import run
    from companion.desk.survey.tiled.task_engine import engine

__all__ = ["MapOptions", "engine", "run"]

WHERE = {"MapOptions": "map_options", "run": "map_run", "engine": "tiled.task_engine"}


def __getattr__(name: str) -> Any:
    if name not in WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{WHERE[name]}"), name)
