"""Safe landing zones from LiDAR: windows of returns in, zones and landing points out."""

from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.landing_point import PointState, SelectedPoint
from slz.maps import SAFE, UNKNOWN, UNSAFE, TerrainMaps
from slz.pipeline import Pipeline
from slz.report import Report
from slz.window import Scan, Window, Windower, join
from slz.zone import LandingPoint, Obstacle, Zone

__all__ = [
    "SAFE",
    "UNKNOWN",
    "UNSAFE",
    "Box",
    "Grid",
    "LandingPoint",
    "LocalFrame",
    "Obstacle",
    "Pipeline",
    "PointState",
    "Report",
    "Scan",
    "SelectedPoint",
    "TerrainMaps",
    "Window",
    "Windower",
    "Zone",
    "join",
]
