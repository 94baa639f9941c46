"""Stored clouds: `slz map`."""

from companion.survey.command import Plan, run
from companion.survey.tiled.engine import engine

__all__ = ["Plan", "engine", "run"]
