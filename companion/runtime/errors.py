"""What can go wrong for whoever runs the program; everything expected is a value instead."""

from __future__ import annotations


class CompanionError(Exception):
    """The program cannot go on; one line says why (exit code 1)."""


class UsageError(CompanionError):
    """The user asked for something that cannot be; one line says what, where and what to do (exit code 2)."""
