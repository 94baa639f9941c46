"""How does slz begin with the safe map of another program? As a prior, which returns may only contradict."""

import matplotlib.pyplot as plt
import numpy as np

import params
from slz import SAFE, UNSAFE, Grid, LocalFrame, Pipeline, Window
from slz.prior import Surveyed

# The other program's map: cells of 1 m, safe but for a wood in the east, level (m, degrees).
grid = Grid(west_m=-40, south_m=-40, cell_m=1.0, rows=80, cols=80)
state = np.full((80, 80), SAFE, np.uint8)
state[:, 60:] = UNSAFE
flat = np.zeros((80, 80), np.float32)
known = Surveyed(grid, state, height_m=flat, slope_deg=flat)

pipeline = Pipeline(params.load("quadcopter"), (0.0, 0.0), prior=lambda frame, position: known)
rng = np.random.default_rng(1)
for second in range(3):  # the vehicle sees 20 m x 20 m of it, with a truck that was not there before
    points = rng.uniform((-10, -10, -0.02), (10, 10, 0.02), (20_000, 3))
    points[:, 2] += 0.02 * points[:, 0] + 3 * ((abs(points[:, 0]) < 4) & (abs(points[:, 1] - 5) < 1.5))
    stamps = np.int64(second * 10**9) + np.arange(len(points))
    sensor, frame = np.array([0.0, 0.0, 20.0]), LocalFrame(47.4, 8.5, 500.0)
    report = pipeline.process(Window(points, stamps, sensor, frame, int(stamps[0]), int(stamps[-1])))

seen, surveyed = report.zones[0], report.prior.zones[0]
print(f"seen by the vehicle: {seen.area_m2:.0f} m2, certainty {seen.certainty:.2f}: land there")
print(f"known from the map: {surveyed.area_m2:.0f} m2, certainty {surveyed.certainty:.2f}: look first")

plt.figure(figsize=(4.5, 4), layout="constrained")
for part, colours in ((report.prior, "Blues"), (report.near, "Greens")):
    zone, cell = part.zones[0], part.grid.cell_m
    west, south = part.grid.west_m + zone.box.col0 * cell, part.grid.south_m + zone.box.row0 * cell
    height, width = np.multiply(zone.cells.shape, cell)
    extent = (west, west + width, south, south + height)
    cells = np.ma.masked_equal(zone.cells, 0) * 0.6
    plt.imshow(cells, colours, origin="lower", extent=extent, vmin=0, vmax=1)
plt.axis((-40, 40, -40, 40))
plt.title("known (blue), seen (green)")
plt.savefig("known_ground.png", dpi=80)
