"""Flash LiDAR: one pulse illuminates the whole scene, and every pixel records its own echo."""

from sitl.sensors.flash.flash_sensor import FlashLidar
from sitl.sensors.flash.focal_plane import FocalPlane, RawFrame

__all__ = ["FlashLidar", "FocalPlane", "RawFrame"]
