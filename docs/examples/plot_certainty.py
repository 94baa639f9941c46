"""How certain is it that a place is safe? Three windows of one hill, whose sides become too steep."""

import matplotlib.pyplot as plt
import numpy as np

import params
from slz import LocalFrame, Pipeline, Window

rng = np.random.default_rng(1)
pipeline = Pipeline(params.load("quadcopter"), centre_enu_m=(0.0, 0.0))
figure, panels = plt.subplots(1, 3, figsize=(9, 3.2), layout="constrained")

for second, panel in enumerate(panels):
    # 15 returns on each square metre in one second, with errors of 2 cm, by a sensor 20 m above the top
    points = rng.uniform((-15, -15, 0), (15, 15, 0), (13_500, 3))
    points[:, 2] = -0.008 * (points[:, 0] ** 2 + points[:, 1] ** 2) + rng.normal(0, 0.02, len(points))
    stamps = np.int64(second * 10**9) + np.arange(len(points)) * 70_000
    sensor, frame = np.array([0.0, 0.0, 20.0]), LocalFrame(47.4, 8.5, 500.0)
    report = pipeline.process(Window(points, stamps, sensor, frame, int(stamps[0]), int(stamps[-1])))

    maps = pipeline.maps()
    certainty = maps.certainty  # probability that the whole footprint is safe, 0 where unknown
    best = f", best zone {report.zones[0].certainty:.2f}" if report.zones else ", no zone"
    print(f"after {second + 1} s: greatest certainty {certainty.max():.2f}{best}")
    shown = panel.imshow(certainty, origin="lower", extent=(-15, 15, -15, 15), vmin=0, vmax=1)
    panel.set_title(f"after {second + 1} s")
    panel.set_xlabel("east, m")

panels[0].set_ylabel("north, m")
figure.colorbar(shown, ax=panels, label="probability of safe")
figure.savefig("plot_certainty.png", dpi=64)
