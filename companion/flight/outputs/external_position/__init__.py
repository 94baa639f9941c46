"""Position of the LiDAR odometry for the autopilot's estimator."""
