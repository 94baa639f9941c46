"""Verdict and figures of a demonstration in words, for the terminal and the page of the flight."""

from __future__ import annotations

from typing import Any

from rich.table import Table

BY_TRUTH = "(simulator's truth)"
BY_VEHICLE = "as the pilot is told: by the vehicle's own position, which errs"


def verdict(summary: dict[str, Any]) -> str:
    """Return how it ended."""
    good = summary["landed"] and summary["touchdown_safe"]
    return "landed on safe ground" if good else "did NOT land on safe ground"


def facts(summary: dict[str, Any]) -> dict[str, str]:
    """Return the figures in words, by name."""
    error, area = summary["touchdown_error_m"], summary["area_error"]
    tilt, own = summary["touchdown_tilt_deg"], summary["off_point_m"]
    return {
        "touchdown, true": "-" if error is None else f"{error:.2f} m from the chosen point {BY_TRUTH}",
        "touchdown, estimated": "-" if own is None else f"{own:.2f} m from it, {BY_VEHICLE}",
        "stands at": "-" if tilt is None else f"{tilt:.1f} degrees on its gear (truth)",
        **({"why unsafe": fault} if (fault := summary["touchdown_fault"]) else {}),
        "zones": f"{len(summary['zones'])} now, {summary['zones_seen']} in all",
        "area error, Eq. (20)": "-" if area is None else f"{area:.3f}",
        "unsafe ground called safe": f"{100 * summary['unsafe_as_safe']:.3f} % of the cells seen",
        "safe ground found": f"{100 * summary['recall']:.1f} %",
        "aborts": f"{summary['aborts']} {', '.join(summary['abort_reasons'])}".rstrip(),
        "ground seen to report": "p50 {p50} ms, p99 {p99} ms, max {max} ms".format(**summary["latency_ms"]),
        "flight": f"{summary['simulated_s']:.0f} s simulated in {summary['wall_s']:.0f} s",
    }


def table(summary: dict[str, Any]) -> Table:
    """Return verdict, figures and files as a table for the terminal."""
    title = f"{summary['scene']}, seed {summary['seed']}: {verdict(summary)}"
    shown = Table(title=title, show_header=False)
    files = {"maps": ", ".join(summary["maps"].values()) or "-", **summary["files"]}
    for name, value in (facts(summary) | files).items():
        shown.add_row(name, value)
    return shown
