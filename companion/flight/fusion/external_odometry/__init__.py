"""Odometry of another program: its poses, their clock and frame, and the correction that they give."""
