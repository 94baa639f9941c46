"""Interferometric radar: from two complex images to a DEM with its standard deviation (Radar letter)."""
