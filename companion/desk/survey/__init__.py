"""Surveys of stored clouds (`slz map`). Imports are lazy because `slz nearest` needs none of them."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from companion.desk.survey.map_run import MapOptions, run
    from companion.desk.survey.tiled.task_engine import engine

__all__ = ["MapOptions", "engine", "run"]

WHERE = {"MapOptions": "map_run", "run": "map_run", "engine": "tiled.task_engine"}


def __getattr__(name: str) -> Any:
    if name not in WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{WHERE[name]}"), name)
