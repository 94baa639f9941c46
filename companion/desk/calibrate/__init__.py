"""Calibration of the LiDAR's boresight and time offset from a recorded flight."""
