"""Autopilots: an object each that says how it differs, and the registry that finds it by its heartbeat."""
