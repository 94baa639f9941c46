"""Side-looking interferometric radar in the Ka band, line by line along the flight."""

from sitl.sensors.radar.side_looker import RawLines, SideLooker, Track

__all__ = ["RawLines", "SideLooker", "Track"]
