"""Recorded flights, run again."""
