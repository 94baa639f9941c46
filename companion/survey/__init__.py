"""Stored clouds: `slz map`."""

from companion.survey.command import run

__all__ = ["run"]
