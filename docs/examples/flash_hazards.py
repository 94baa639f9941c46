"""Which hazards does one image of a flash LiDAR show? Simulated, from 250 m; see `docs/instruments.md`."""

import matplotlib.pyplot as plt
import numpy as np

from sitl import scenes
from sitl.sensors.flash import FlashLidar
from slz.flash.camera import FlashCamera, FlashFrame
from slz.flash.elevation import elevation_map, grid_around, relative_elevation
from slz.flash.frame_processing import map_points, process_frame, sensor_points
from slz.flash.hazard_detection import find_hazards

# The simulated sensor flies 200 m high and looks north, 37 degrees off the vertical, at two boxes in a pit.
half = np.radians(37) / 2
position = np.array([0.0, -200 * np.tan(2 * half), 200.0])
attitude = np.array([np.cos(half), 0.0, np.sin(half), 0.0])  # quaternion w, x, y, z, body to north-east-down
lidar = FlashLidar(np.random.default_rng(1))
raw = lidar.flash(position, attitude, scenes.build("borrow_pit", seed=1).world)

# Waveforms to ranges, ranges to points of the map; its axes are east, north, up.
camera = FlashCamera()
image = process_frame(FlashFrame(raw.samples, raw.counter), camera)
points_sensor, _ = sensor_points(image, camera)
axes = lidar.mount.to_enu(np.eye(3), np.tile(attitude, (3, 1))).T
points = map_points(points_sensor, position, axes)

# Points to heights over the ground around, and these to hazards.
grid = grid_around(points, cell_m=0.2)
dem = relative_elevation(elevation_map(points, grid))
hazards = find_hazards(dem, grid)
for hazard in hazards[:2]:
    print(f"{hazard.height_m:.1f} m high, at {hazard.east_m:.1f} m east and {hazard.north_m:.1f} m north")

east_m, north_m = grid.west_m + grid.cols * grid.cell_m, grid.south_m + grid.rows * grid.cell_m
extent = (grid.west_m, east_m, grid.south_m, north_m)
plt.figure(figsize=(5, 4.2), layout="constrained")
plt.colorbar(plt.imshow(dem, origin="lower", extent=extent, vmin=0, vmax=2), label="over the ground, m")
for west, south, east, north in (hazard.extent_m for hazard in hazards):
    plt.plot([west, east, east, west, west], [south, south, north, north, south], "r")
plt.savefig("flash_hazards.png", dpi=72)
