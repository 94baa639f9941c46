"""ROS 2 node of the companion: maps, zones, landing point, pose and diagnostics as ROS messages."""
