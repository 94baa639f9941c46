"""Diagnosis of a LiDAR's stream and clock: cause and remedy in one sentence."""
