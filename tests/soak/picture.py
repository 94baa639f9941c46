"""Plot of the gauges' readings over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt

from tests.soak.gauges import Reading

PANELS = (
    ("resident memory, MiB", ("rss_mib",)),
    ("latency, ms", ("latency_p50_ms", "latency_p99_ms")),
    ("open and running", ("descriptors", "threads", "tasks")),
)


def draw(readings: Sequence[Reading], path: Path) -> None:
    """Draw memory, latency and counts over the hours into a PNG file."""
    figure, axes = plt.subplots(len(PANELS), 1, figsize=(10, 8), sharex=True, layout="constrained")
    at_h = [r.at_h for r in readings]
    for ax, (title, names) in zip(axes, PANELS, strict=True):
        for name in names:
            ax.plot(at_h, [getattr(r, name) for r in readings], label=name, linewidth=1)
        ax.set_title(title, fontsize=10, loc="left")
        ax.grid(alpha=0.3)
        if len(names) > 1:
            ax.legend(fontsize=8)
    axes[-1].set_xlabel("hours")
    figure.savefig(path, dpi=90)
    plt.close(figure)
