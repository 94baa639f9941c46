"""Checks of the LiDAR's packets: rate, loss, integrity, clock; and what its diagnosis says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from companion.flight.doctor.finding import Finding, judged
from companion.flight.sensors.diagnosis import explanation
from companion.flight.sensors.diagnosis.lidar_diagnosis import Episode

LEAST_HZ = 10_000.0
LOSS = 0.01


def lidar_findings(
    url: str,
    seconds: float,
    packets: int,
    statistics: Mapping[str, int | float | None],
    episodes: Sequence[Episode] = (),
) -> list[Finding]:
    """Judge the driver's counters, `packets` arrived within `seconds`, and name each cause diagnosed."""
    if not packets:
        return [_silence(url, statistics, episodes)]
    return [*_counted(seconds, packets, statistics), *_diagnosed(episodes)]


def _diagnosed(episodes: Sequence[Episode]) -> list[Finding]:
    """Return a finding for each cause, the latest of its kind."""
    causes = {episode.cause: episode.explanation for episode in episodes}
    return [Finding("LiDAR", why.level, why.sentence, "", why.remedy) for why in causes.values()]


def _counted(seconds: float, packets: int, statistics: Mapping[str, int | float | None]) -> list[Finding]:
    lost, spoilt = _count(statistics, "lost_packets"), _count(statistics, "bad_checksum")
    malformed = _count(statistics, "malformed")
    points_hz = _count(statistics, "returns") / seconds
    share = lost / (packets + lost)
    return [
        Finding("LiDAR packets", "ok", f"{packets / seconds:.0f} Hz"),
        judged(
            "LiDAR returns",
            points_hz >= LEAST_HZ,
            f"{points_hz:.0f} a second",
            f"at least {LEAST_HZ:.0f}",
            "usual on the ground; in flight see that its window is clean and that it looks at the ground",
            otherwise="warn",
        ),
        judged(
            "LiDAR packets lost",
            share <= LOSS,
            f"{100 * share:.2f} %",
            f"at most {100 * LOSS:g} %",
            f"{explanation.NETWORK}; {explanation.BUFFER}",
        ),
        judged(
            "LiDAR packets spoilt",
            spoilt + malformed == 0,
            f"{spoilt} bad checksums, {malformed} malformed",
            "none",
            "see that nothing else sends to this port, and that the sensor's firmware is current",
            otherwise="warn",
        ),
        judged(
            "LiDAR clock",
            not _count(statistics, "clock_resets"),
            f"{_count(statistics, 'clock_resets')} jumps",
            "none",
            "synchronise it by PTP or leave it free-running, but do not change that in flight",
        ),
        *_following(statistics),
    ]


def _following(statistics: Mapping[str, int | float | None]) -> list[Finding]:
    follows = statistics.get("clock_follows")
    if follows is None:
        return []
    said = "synchronised" if follows else "not this computer's time"
    return [judged("LiDAR time", bool(follows), said, "by lidar_clock", explanation.MASTER)]


def _silence(url: str, statistics: Mapping[str, int | float | None], episodes: Sequence[Episode]) -> Finding:
    if episodes:
        why = episodes[-1].explanation
        return Finding("LiDAR packets", "fail", f"none at {url}: {why.sentence}", "packets", why.remedy)
    remedy = "set the sensor's destination to this computer and that port, and check cable and subnet"
    if _count(statistics, "malformed") or _count(statistics, "bad_checksum"):
        remedy = "something else sends to this port: check the sensor's model and its point-data port"
    if _count(statistics, "wrong_sensor"):
        remedy = "another maker's sensor sends to this port: name that one in --lidar, or use another port"
    return Finding("LiDAR packets", "fail", f"none at {url}", "packets", remedy)


def _count(statistics: Mapping[str, int | float | None], name: str) -> int:
    return int(statistics.get(name) or 0)
