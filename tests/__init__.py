"""Tests of slz, companion, params and sitl."""

from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
