"""Where do wires hang in a cloud of points, and how high?"""

import matplotlib.pyplot as plt
import numpy as np

import params
from slz import LocalFrame, Pipeline, Window

rng = np.random.default_rng(1)
pipeline = Pipeline(params.load("quadcopter"), centre_enu_m=(0.0, 0.0))
frame, clouds = LocalFrame(47.4, 8.5, 500.0), []
for second in range(8):  # a vehicle comes down from 24 m to a wire across its way, 9 m up
    sensor = np.array([0.0, -6.0 + second, 24.0 - second])
    ground = rng.uniform((-20, -20, 0), (20, 20, 0), (30_000, 3))
    ground[:, 2] = 0.04 * ground[:, 0]
    along = rng.uniform(-25, 25, 40)  # 40 returns on 50 m of sagging wire
    wire = np.column_stack([along, np.full(40, 6.0), 8.2 + 0.8 * (along / 25) ** 2])
    points = np.concatenate([ground, wire]) + rng.normal(0, 0.01, (len(ground) + len(wire), 3))
    stamps = np.full(len(points), second * 10**9)
    # From where each return was measured: between there and the return the air is empty.
    scan = {"origin": np.zeros(len(points), np.uint16), "origins_enu_m": sensor[np.newaxis]}
    report = pipeline.process(Window(points, stamps, sensor, frame, second * 10**9, second * 10**9, **scan))
    clouds.append(points)

for found in report.wires:
    (west, _, low), (east, _, _) = found.ends_enu_m
    print(
        f"wire of {found.n_returns} returns from {west:.0f} to {east:.0f} m east, {low:.1f} m up at its end"
    )

plt.figure(figsize=(7, 3), layout="constrained")
for cloud in clouds:
    for part, colour in ((cloud[::40], "grey"), (cloud[-40:], "black")):
        plt.plot(part[:, 0], part[:, 2], ".", markersize=2, color=colour)
for found in report.wires:
    curve, _, _ = found.sampled(step_m=0.5)
    plt.plot(curve[:, 0], curve[:, 2], "r", linewidth=1)
plt.title("returns (dots), wire found (red)")
plt.gca().set(xlabel="east, m", ylabel="up, m")
plt.savefig("wires_in_cloud.png", dpi=80)
