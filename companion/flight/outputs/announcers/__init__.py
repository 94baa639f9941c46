"""Announcers: texts for the pilot about wires that were found, and about faults of the LiDAR."""
