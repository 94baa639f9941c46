"""How steep and how rough is the ground in one window of points?"""

import matplotlib.pyplot as plt
import numpy as np

import params
from slz import LocalFrame, Pipeline, Window

# West of 0 a meadow that rises by 8 degrees, east of 0 level rubble with stones of some 10 cm.
rng = np.random.default_rng(1)
points = rng.uniform((-20, -10, -0.01), (20, 10, 0.01), (40_000, 3))
east = points[:, 0]
points[:, 2] += np.where(east < 0, np.tan(np.radians(8)) * east, rng.normal(0, 0.1, len(points)))
stamps = np.arange(len(points)) * 1000  # ns
sensor, frame = np.array([0.0, 0.0, 25.0]), LocalFrame(47.4, 8.5, 500.0)
window = Window(points, stamps, sensor, frame, int(stamps[0]), int(stamps[-1]))

pipeline = Pipeline(params.load("quadcopter"), centre_enu_m=(0.0, 0.0))
pipeline.process(window)
maps = pipeline.maps()

# Both layers belong to the plane under the vehicle's footprint around a cell, NaN where too little is known.
column = maps.west_m + (np.arange(maps.slope_deg.shape[1]) + 0.5) * maps.grid.cell_m
for name, side in (("meadow", (column > -18) & (column < -2)), ("rubble", (column > 2) & (column < 18))):
    slope, roughness = np.nanmedian(maps.slope_deg[:, side]), np.nanmedian(maps.roughness[:, side])
    print(f"{name}: slope {slope:.1f} degrees, roughness {100 * roughness:.1f} cm")

figure, panels = plt.subplots(1, 2, figsize=(7, 2.3), layout="constrained")
layers = {"slope, degrees": maps.slope_deg, "roughness, m": maps.roughness}
for panel, (label, layer) in zip(panels, layers.items(), strict=True):
    height, width = np.multiply(layer.shape, maps.grid.cell_m)
    extent = (maps.west_m, maps.west_m + width, maps.south_m, maps.south_m + height)
    figure.colorbar(panel.imshow(layer, origin="lower", extent=extent), ax=panel, label=label)
    panel.set(xlabel="east, m", ylabel="north, m")
figure.savefig("slope_and_roughness.png", dpi=72)
