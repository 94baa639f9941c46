"""Report sentences on lost measurements of a replay and on empty results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from companion.desk.replay.captures.captured_packets import snapped_packets
from companion.desk.replay.foreign_replay import Feed, Rerun
from companion.desk.replay.own_replay import ReplayOutcome
from companion.desk.replay.recorder_clock import fitting_offset, time_of_day
from params import Parameters
from slz import SAFE, UNKNOWN, TerrainMaps

Counts = Mapping[str, Any]
ABOVE_SHARE = 0.5  # share of points above the vehicle beyond which their heights are of another datum


def lost_for_time(source: Counts, returns: Counts) -> list[str]:
    """Return a sentence for each kind of loss that is due to times or poses: returns lost or not de-skewed.

    Parameters
    ----------
    source
        `Feed.summary`.
    returns
        `Rerun.returns` as `read`, and the assembler's statistics.
    """
    read, points = returns["read"], source.get("points")
    clouds, why = source.get("clouds"), source.get("why_no_point_times")
    found = [
        (returns["without_pose"], f"of {read} returns have no poses around them"),
        (returns["stale"], f"of {read} returns were too far from any pose (pose_timeout_s)"),
        (source.get("points_outside_log", 0), f"of {points} points were not measured during the log"),
        (source.get("before_position", 0), f"of {points} points were measured before the first position"),
        (source.get("messages_without_stamp", 0), "messages were dropped: they have no time, as others have"),
        (
            source.get("messages_with_false_stamp", 0),
            "messages were dropped: their stamps contradict those before and after",
        ),
        (
            source.get("points_with_false_times", 0),
            "points were dropped: their times are far from those of their clouds",
        ),
        (
            source.get("clouds_without_point_times", 0),
            f"of {clouds} clouds have no usable times of points, so they are not de-skewed: {why}"
            if why
            else f"of {clouds} clouds are left out: the times of their points are unlike those of the others",
        ),
    ]
    said = [f"{count} {sentence}" for count, sentence in found if count]
    said += [
        f"messages on {topic} have no time: that of the recorder is used, which is later by the delay"
        for topic in source.get("stamped_by_recorder", ())
    ]
    said += snapped_packets(source)
    if source.get("unreadable"):
        said.append(f"{source['unreadable']} packets of the capture cannot be read")
    if source.get("times") != source.get("times_in_header"):
        said.append(
            f"times of points are {source['times']}, though the header tells {source['times_in_header']}"
        )
    coarse = returns.get("attitudes_too_far_apart")
    if coarse:
        said.append(
            f"attitudes are {coarse} times too far apart for the vehicle's turns: they would err by up to"
            f" {returns['attitude_error_deg']:g} degrees; what is between is left out; record 25 a second"
        )
    said += clock_steps(source)
    above, compared = source.get("points_above_vehicle", 0), source.get("points_beside_vehicle", 0)
    if above > ABOVE_SHARE * compared:
        said.append(
            f"{above} of {compared} points lie above the vehicle that measured them: their heights are of"
            f" another datum than the log's (mean sea level); the cloud's is {source['vertical_datum']}"
        )
    copies, late = source.get("frames_repeated", 0), source.get("messages_late", 0)
    if copies or late:
        said.append(
            f"{copies} frames of the log came once more and {late} more than a second late: they are not used"
        )
    resets = source.get("packets", {}).get("clock_resets", 0)
    return [*said, f"the LiDAR's clock jumped {resets} times"] if resets else said


def why_nothing(feed: Feed, rerun: Rerun) -> str:
    """Return the reason why no return could be georeferenced."""
    others = [
        *clock_steps(feed.summary()),
        *snapped_packets(feed.summary()),
        *feed.summary().get("not_read", ()),
        *absent(feed.summary()),
        *([f"{feed.bad} messages cannot be read"] if feed.bad else []),
    ]
    if not rerun.returns or rerun.span_ns is None:
        return "; ".join(["it holds no return of the LiDAR", *others])
    if rerun.poses_ns is None and feed.summary().get("positions_without_fix"):
        return "; ".join(["its autopilot has no fix, by its own GPS_RAW_INT or estimator's flags", *others])
    if rerun.poses_ns is None:
        return "; ".join(["it holds no attitude, or no position, of the vehicle", *others])
    (first, last), (begun, ended) = rerun.span_ns, rerun.poses_ns
    if last < begun or first > ended:
        return (
            f"returns of {time_of_day(first)} to {time_of_day(last)} have no poses, which are of"
            f" {time_of_day(begun)} to {time_of_day(ended)}: their clocks are not the same,"
            f" {'; '.join([fitting_offset(rerun.span_ns, rerun.poses_ns), *clock_steps(feed.summary())])}"
        )
    counts = rerun.assembler.statistics()
    return (
        f"none of {rerun.returns} returns could be placed: {counts['out_of_range']} out of range,"
        f" {counts['without_pose']} without poses around them, {counts['stale']} too far from any pose"
    )


def why_no_zone(outcome: ReplayOutcome, maps: TerrainMaps | None, parameters: Parameters) -> str:
    """Return the areas seen, judged and safe, as the reason why there is no zone."""
    if not outcome.windows:
        return "no window was mapped"
    if outcome.failed == outcome.windows or maps is None:
        return f"{outcome.failed} of {outcome.windows} windows failed, and no map was made"
    cell_m2 = maps.grid.cell_m**2
    seen, judged, safe = (
        np.count_nonzero(which) * cell_m2
        for which in (np.isfinite(maps.height_m), maps.state != UNKNOWN, maps.state == SAFE)
    )
    return (
        f"{seen:.0f} m2 of ground were seen, enough of it to judge {judged:.0f} m2; {safe:.0f} m2 are safe,"
        f" without a square of {parameters.min_square_m:g} m"
    )


def not_mapped(feed: Feed, rerun: Rerun) -> list[str]:
    """Return the reasons why measurements are not on the map, for an empty one."""
    counts = rerun.assembler.statistics()
    reasons = {
        "out_of_range": "out of range (lidar_min_m, lidar_max_m)",
        "repeated_picture": "of a picture that the LiDAR repeats",
        "vehicle": "of the vehicle itself",
        "dust": "of dust",
        "pitched": "of a sensor pitched too far",
    }
    found = [
        f"{counts[name]} of {rerun.returns} returns were {why}"
        for name, why in reasons.items()
        if counts[name]
    ]
    if rerun.standing_scans:
        found.append(f"{rerun.standing_scans} scans were made while the vehicle stood on the ground")
    if rerun.history.epoch:
        found.append(f"the position estimate jumped {rerun.history.epoch} times, and the map began anew")
    return [*absent(feed.summary()), *found]


def clock_steps(source: Counts) -> list[str]:
    """Return a sentence for each time that the recorder's clock was set."""
    return [
        f"the recorder's clock was set by {one['step_ns'] * 1e-9:+.1f} s at {time_of_day(one['at_ns'])}:"
        " times before it are counted on the clock after it"
        for one in source.get("clock_steps", ())
    ]


def absent(source: Counts) -> list[str]:
    """Return counts of packets' or clouds' measurements without a return, and of unreadable packets."""
    packets = source.get("packets", {})
    zeros = packets.get("no_return", 0) + source.get("points_without_return", 0)
    doubtful = packets.get("low_confidence", 0) + source.get("points_of_low_confidence", 0)
    found = [
        (zeros, "measurements were no return (zeros or NaN)"),
        (doubtful, "returns were of low confidence"),
        (packets.get("malformed", 0), "packets were malformed"),
        (packets.get("bad_checksum", 0), "packets had a wrong checksum"),
        (packets.get("foreign", 0), "packets were another sensor's"),
        (packets.get("wrong_sensor", 0), "packets were of another kind of sensor"),
        (packets.get("failed", 0), "packets could not be decoded"),
    ]
    return [f"{count} {what}" for count, what in found if count]
