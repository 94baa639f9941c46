"""Stored clouds: `slz map`."""

from companion.survey.survey import run

__all__ = ["run"]
