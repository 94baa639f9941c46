"""Where in an array of points can I land, and how certain is that?"""

import matplotlib.pyplot as plt
import numpy as np

import params
from slz import SAFE, UNKNOWN, LocalFrame, Pipeline, Window

# Points are metres east, north and up of an origin: level ground with a shed, and a pond without returns.
rng = np.random.default_rng(1)
points = rng.uniform((0, 0, -0.02), (60, 40, 0.02), (40_000, 3))
points[np.hypot(points[:, 0] - 20, points[:, 1] - 20) < 3, 2] += 3.0
points = points[np.hypot(points[:, 0] - 45, points[:, 1] - 12) > 5]

stamps = np.arange(len(points)) * 1000  # ns, when each point was measured
sensor = np.full(3, np.nan)  # where the sensor was: not known here
frame = LocalFrame(47.4, 8.5, 500.0)  # latitude, longitude and altitude of the origin
window = Window(points, stamps, sensor, frame, int(stamps[0]), int(stamps[-1]))

pipeline = Pipeline(params.load("quadcopter"))
report = pipeline.process(window)
for zone in report.zones:  # the best to land in first
    east, north, up = zone.best.enu_m
    print(f"zone {zone.id}: {zone.area_m2:.0f} m2, slope {zone.slope_deg:.1f} degrees")
    print(f"  land {east:.1f} m east, {north:.1f} m north: safe with probability {zone.best.certainty:.2f}")

maps = pipeline.maps()  # row 0 is the southernmost
state = np.where(maps.state == UNKNOWN, np.nan, maps.state == SAFE)
height, width = np.multiply(state.shape, maps.grid.cell_m)
extent = (maps.west_m, maps.west_m + width, maps.south_m, maps.south_m + height)
plt.figure(figsize=(5, 3.5), layout="constrained")
plt.imshow(state, origin="lower", extent=extent, cmap="RdYlGn", vmin=0, vmax=1)
plt.plot(*report.zones[0].best.enu_m[:2], "k+", markersize=14)
plt.title("safe, unsafe, unknown (white), best point (+)")
plt.xlabel("east, m")
plt.ylabel("north, m")
plt.savefig("zones_from_array.png", dpi=80)
