"""LiDAR odometry under drift, against the true pose."""
