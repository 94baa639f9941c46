"""The method on a LAS or LAZ file: read, one window, one report, a picture.

Run it as it is, or cell by cell (`# %%`). Coordinates must be metres east, north and up; `slz map` handles
any CRS, unit and size.
"""

# %% What it needs: slz is the science alone, without links, sensors or files
import sys
from pathlib import Path

import laspy
import matplotlib
import numpy as np

import params
from slz import SAFE, UNKNOWN, LocalFrame, Pipeline, Window

matplotlib.use("Agg")
import matplotlib.pyplot as plt

# %% A file: yours, or a field of 60 m x 40 m with a shed and a pond, in which nothing returns
file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("field.las")
if len(sys.argv) == 1:
    rng = np.random.default_rng(1)
    e, n = (axis.ravel() + rng.uniform(0, 0.2, axis.size) for axis in np.mgrid[0:60:0.25, 0:40:0.25])
    u = rng.normal(0.0, 0.01, len(e)) + 3.0 * ((abs(e - 20) < 2) & (abs(n - 20) < 2))
    dry = np.hypot(e - 45, n - 12) > 5
    las = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    las.x, las.y, las.z = e[dry], n[dry], u[dry]
    las.write(file)

# %% Points about a local origin; NaN is "not known", here for where the sensor was
las = laspy.read(file)
points = np.column_stack([las.x, las.y, las.z]).astype(np.float64)
points -= (*np.floor(points[:, :2].mean(axis=0)), 0.0)
stamps = np.arange(len(points), dtype=np.int64) * 1000  # ns, not decreasing
frame = LocalFrame(47.4, 8.5, 500.0)  # where on the Earth the origin lies, for latitudes and longitudes
window = Window(points, stamps, np.full(3, np.nan), frame, int(stamps[0]), int(stamps[-1]))

# %% Every number of the method is a parameter; a value out of range is refused
parameters = params.load("quadcopter", ["cell_m=0.5", "min_square_m=5", "max_age_s=86400"])
pipeline = Pipeline(parameters, centre_enu_m=(0.0, 0.0))
report = pipeline.process(window)

# %% Zones, the best to land in first, each with the reason for its place
print(f"{report.n_used} of {report.n_points} returns, {report.total_ms:.0f} ms")
for zone in report.zones:
    print(
        f"zone {zone.id}: {zone.area_m2:.0f} m2, certainty {zone.certainty:.2f}, slope {zone.slope_deg:.1f}"
        f" degrees, land at {np.round(zone.best.enu_m, 1)} {zone.why}"
    )

# %% The maps behind it: unknown is never safe
maps = pipeline.maps()
if maps is None:
    raise SystemExit("no return was used: is the file in metres?")
shown = np.where(maps.state == UNKNOWN, np.nan, maps.state == SAFE)
plt.imshow(shown, origin="lower", cmap="RdYlGn", vmin=0, vmax=1)
plt.title(f"safe (green), unsafe (red), unknown (white), cells of {maps.grid.cell_m} m")
plt.savefig(file.with_suffix(".png"), dpi=120)
print(f"wrote {file.with_suffix('.png')}")
