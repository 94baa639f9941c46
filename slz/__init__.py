"""Safe landing zones from LiDAR: windows of returns in, zones and landing points out."""

from slz.adaptive import Choice
from slz.drawn import Drawn, DrawnTile
from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.landing_point import PointState, SelectedPoint
from slz.maps import SAFE, UNKNOWN, UNSAFE, TerrainMaps
from slz.nearby import Nearby
from slz.pipeline import Pipeline
from slz.report import MapReport, Report
from slz.surroundings import Obstacle, Surroundings
from slz.window import Scan, Window, Windower, join
from slz.zone import LandingPoint, Zone, zone_mask

__all__ = [
    "SAFE",
    "UNKNOWN",
    "UNSAFE",
    "Box",
    "Choice",
    "Drawn",
    "DrawnTile",
    "Grid",
    "LandingPoint",
    "LocalFrame",
    "MapReport",
    "Nearby",
    "Obstacle",
    "Pipeline",
    "PointState",
    "Report",
    "Scan",
    "SelectedPoint",
    "Surroundings",
    "TerrainMaps",
    "Window",
    "Windower",
    "Zone",
    "join",
    "zone_mask",
]
