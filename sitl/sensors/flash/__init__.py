"""Flash LiDAR: one pulse illuminates the whole scene, and every pixel records its own echo."""

from sitl.sensors.flash.focal_plane import FocalPlane, RawFrame
from sitl.sensors.flash.instrument import FlashLidar

__all__ = ["FlashLidar", "FocalPlane", "RawFrame"]
