"""Where can I land in a LAZ file? `python map_laz.py FILE.laz`, or without a file a small one."""

import json
import subprocess
import sys

import laspy
import matplotlib.pyplot as plt
import numpy as np
import rasterio
from pyproj import CRS

file = sys.argv[1] if len(sys.argv) > 1 else "field.laz"
if len(sys.argv) == 1:  # a sloping field with a barn, a steep bank in the north, and a pond without returns
    rng = np.random.default_rng(1)
    east, north = rng.uniform(0, (80, 60), (60_000, 2)).T
    up = 6.0 * ((abs(east - 25) < 6) & (abs(north - 25) < 4)) + 0.5 * np.maximum(north - 48, 0) + 0.04 * east
    dry = np.hypot(east - 60, north - 20) > 8
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    las.header.add_crs(CRS("EPSG:2056+5728"))  # Swiss coordinates and heights
    las.x, las.y = 2_600_000 + east[dry], 1_200_000 + north[dry]
    las.z = 550 + up[dry] + rng.normal(0, 0.01, dry.sum())
    las.write(file)

# The file says in which CRS and unit it is; the parameters are those of a quadcopter.
subprocess.run(["slz", "map", file, "--out", "zones", "--json"], check=True, stdout=subprocess.PIPE)

with open("zones/zones.geojson") as text:
    zones = [feature["properties"] for feature in json.load(text)["features"]]
for zone in zones:
    print(f"zone {zone['id']}: {zone['area_m2']:.0f} m2, slope {zone['slope_deg']:.1f} degrees")

with rasterio.open("zones/safe.tif") as raster:  # 0 unsafe, 1 safe, 255 unknown, in the CRS of the file
    safe = np.ma.masked_equal(raster.read(1), 255)
plt.figure(figsize=(4.5, 3.6), layout="constrained")
plt.imshow(safe, cmap="RdYlGn", vmin=0, vmax=1)
plt.axis("off")
plt.title("safe (green), unsafe (red), unknown (white)")
plt.savefig("map_laz.png", dpi=80)
