"""Comparison of classified ground with the truth."""
