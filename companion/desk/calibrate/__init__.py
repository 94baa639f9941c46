"""Boresight and time offset of the LiDAR, found from a recorded flight."""
