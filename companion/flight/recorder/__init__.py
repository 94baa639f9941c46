"""Recordings of flights (MCAP): everything a replay needs, and the same for the eye."""
