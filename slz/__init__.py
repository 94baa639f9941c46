"""Safe landing zones from LiDAR: windows of returns in, zones and landing points out."""

from slz.adaptive import Choice
from slz.airborne.specks import ReturnKind, SpeckDetector, only_objects, without_specks
from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.landing_point.corridors import Corridors
from slz.landing_point.judgement import PointState, SelectedPoint
from slz.landing_point.local_heights import Nearby
from slz.landing_point.obstacles import Obstacle
from slz.landing_point.surroundings import Surroundings
from slz.moving.intrusions import Intrusion, Intrusions
from slz.moving.moving_objects import MovingObjects
from slz.moving.tracks import MovingObject
from slz.pipeline import Pipeline
from slz.report import MapReport, Report
from slz.surface.surface_kinds import SurfaceHere, SurfaceKind
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE, TerrainMaps
from slz.terrain.terrain_view import Drawn, DrawnTile
from slz.window import PointAttributes, Scan, Window, Windower, join
from slz.wires.detected_wire import Wire
from slz.zone import LandingPoint, Zone, zone_mask

__all__ = [
    "SAFE",
    "UNKNOWN",
    "UNSAFE",
    "Box",
    "Choice",
    "Corridors",
    "Drawn",
    "DrawnTile",
    "Grid",
    "Intrusion",
    "Intrusions",
    "LandingPoint",
    "LocalFrame",
    "MapReport",
    "MovingObject",
    "MovingObjects",
    "Nearby",
    "Obstacle",
    "Pipeline",
    "PointAttributes",
    "PointState",
    "Report",
    "ReturnKind",
    "Scan",
    "SelectedPoint",
    "SpeckDetector",
    "SurfaceHere",
    "SurfaceKind",
    "Surroundings",
    "TerrainMaps",
    "Window",
    "Windower",
    "Wire",
    "Zone",
    "join",
    "only_objects",
    "without_specks",
    "zone_mask",
]
