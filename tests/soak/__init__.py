"""Soak: the companion for a day on the simulated clock, and for hours of real time at full rate."""
