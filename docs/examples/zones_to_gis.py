"""How do zones get into a GIS? It opens zones.geojson as it is; here they become a table of points in metres.

The folder `zones` is one of `slz map`, such as that of map_laz.py.
"""

import csv
import json
from pathlib import Path

from pyproj import Transformer
from shapely import transform
from shapely.geometry import shape

CRS = "EPSG:2056"  # of the map that the points are for
to_metres = Transformer.from_crs("EPSG:4326", CRS, always_xy=True).transform

features = json.loads(Path("zones/zones.geojson").read_text())["features"]
rows = []
for feature in features:
    polygon = transform(shape(feature["geometry"]), to_metres, interleaved=False)  # holes are obstacles
    inside = polygon.buffer(-1.5)  # at least 1.5 m from every edge
    if inside.is_empty:
        continue
    point = inside.representative_point()
    rows.append((feature["properties"]["id"], round(point.x, 1), round(point.y, 1), round(polygon.area)))
rows.sort(key=lambda row: -row[3])

with open("landing_points.csv", "w", newline="") as file:
    csv.writer(file).writerows([("zone", "x_m", "y_m", "area_m2"), *rows])
print(Path("landing_points.csv").read_text(), end="")
