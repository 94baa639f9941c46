"""Exceptions of the program; expected outcomes are return values instead."""

from __future__ import annotations


class CompanionError(Exception):
    """Fatal error, explained in one line (exit code 1)."""


class UsageError(CompanionError):
    """Invalid request of the user; one line says what, where and what to do (exit code 2)."""
