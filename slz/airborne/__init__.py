"""Airborne particles: which returns are dust, rain, snow or insects, and which are objects."""
