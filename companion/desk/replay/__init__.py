"""Replay of recorded flights."""
