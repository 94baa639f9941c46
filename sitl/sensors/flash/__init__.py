"""A flash LiDAR: one pulse lights the whole scene, every pixel records its own echo."""

from sitl.sensors.flash.focal_plane import FocalPlane, RawFrame
from sitl.sensors.flash.instrument import FlashLidar

__all__ = ["FlashLidar", "FocalPlane", "RawFrame"]
