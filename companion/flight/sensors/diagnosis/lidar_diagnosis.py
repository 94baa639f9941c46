"""Diagnosis of a LiDAR's stream: which cause is present now, which was, by looks each quarter of a second."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.diagnosis import explanation as explain
from companion.flight.sensors.diagnosis import picture_faults
from companion.flight.sensors.diagnosis.close_returns import CloseReturns
from companion.flight.sensors.diagnosis.explanation import Explanation
from companion.flight.sensors.diagnosis.packet_signs import PacketSigns
from companion.flight.sensors.diagnosis.return_picture import SECTORS, Picture
from companion.flight.sensors.diagnosis.sensor_surroundings import Surroundings, is_ours
from companion.flight.sensors.diagnosis.stream_look import COUNTED, StreamLook, spoilt_of
from companion.flight.sensors.returns import RawReturns

LOOK_NS = 250_000_000
SPAN = 4  # looks that a judgement spans
FORGOTTEN = 64  # episodes kept
OVER_NS = 5_000_000_000  # a cause is over after so long without a sign of it
SILENT_NS = 1_000_000_000
START_NS = 2_500_000_000  # patience with a sensor that was never heard
GAP_NS = 300_000_000
SHOWN_NS = 1_500_000_000  # a pause or a step is one moment: so long it counts as a sign
AFTER_STEP_NS = 4_000_000_000  # so long after a step or a gap the clock is not judged
LOSS, LEAST_LOST = 0.01, 8
SPOILT_SHARE, LEAST_SPOILT = 0.02, 5
LOW_RATE = 0.75
DRIFT_PPM, MOST_PPM = 300.0, 50_000.0
SETTLE = 0.1  # weight of the newest look in what is usual
WANTED = {"ptp": "PTP", "gps": "GPS"}
# Looks in a row that show a cause before it is told.
PATIENCE = {"missing_packets": 5, "low_rate": 3, "other_master": 5, "no_master": 2, "no_pps": 4, "drift": 2}
# A cause is not told beside one of these, which explains it.
EXPLAINED_BY = {
    "missing_packets": ("missing_sector", "pauses", "step", "spoilt"),
    "pauses": ("full_buffer",),
    "low_rate": ("missing_packets", "missing_sector", "pauses", "step", "drift"),
    "other_master": ("no_master", "no_pps", "step"),
    "drift": ("step", "pauses"),
    "covered": ("dirty", "missing_sector", "missing_packets", "low_rate"),
    "dead_lines": ("missing_sector",),
    "spoilt": ("other_maker", "not_as_described"),
}


class StreamClock(Protocol):
    """State of the sensor's clock."""

    @property
    def steps(self) -> int:
        """Number of times that it was set."""

    @property
    def last_step_ns(self) -> int:
        """Size of the newest step."""

    @property
    def drift_ppm(self) -> float | None:
        """Rate of the sensor's clock over ours, ppm; None if unsure."""


class PlacedScans(Protocol):
    """Evidence about the sensor from placing its returns on the map."""

    @property
    def repeated(self) -> int:
        """Number of returns of scans that repeated an earlier picture."""

    @property
    def mount_error_deg(self) -> tuple[float, float] | None:
        """Roll and pitch by which the stated mount is certainly wrong, None where it is not."""


@dataclass(slots=True)
class Episode:
    """A cause from its first sign to its last.

    Attributes
    ----------
    cause
        Name of the cause.
    explanation
        In words, by its first sign.
    began_ns, ended_ns
        Companion clock; None while it lasts.
    """

    cause: str
    explanation: Explanation
    began_ns: int
    ended_ns: int | None = None
    last_sign_ns: int = 0

    def document(self) -> dict[str, Any]:
        """Return the episode as `--json` and the page show it."""
        return {
            "cause": self.cause,
            "text": self.explanation.text,
            "line": self.explanation.line,
            "level": self.explanation.level,
            "began_ns": self.began_ns,
            "ended_ns": self.ended_ns,
        }


class LidarDiagnosis:
    """Judge of one stream.

    A cause counts when it shows in enough looks, once, and is over when no sign of it has come for five
    seconds. Time is that of the arrivals, so that a replay names what the flight named.

    Parameters
    ----------
    reference
        `lidar_clock`: what the sensor's clock should follow.
    signs
        What the packets say of themselves; None for a decoder that keeps none.
    statistics
        Returns the stream's counters.

    Attributes
    ----------
    surroundings
        Returns what is known of the sensor beside its packets; called at each look without points, and
        where packets are missing.
    placed
        Scans that the returns became, None without.
    undecoded
        LiDAR without a decoder that sends to this port, empty without one.
    """

    def __init__(
        self,
        reference: str,
        signs: PacketSigns | None,
        clock: StreamClock,
        statistics: Callable[[], Mapping[str, int | float | None]],
    ) -> None:
        self._reference, self._signs, self._clock = reference, signs, clock
        self._statistics = statistics
        self._described = signs is not None and signs.described
        self._picture = Picture(0.0 if signs is None else signs.near_m)
        self._usual: NDArray[np.float64] = np.zeros(SECTORS)
        self._close = CloseReturns()
        self._looks: deque[StreamLook] = deque(maxlen=SPAN + 1)
        self._begun_ns: int | None = None
        self._looked_ns: int | None = None
        self._last_ns: int | None = None  # arrival of the newest points
        self._stamp_ns = 0
        self._gap_ns, self._gap_at_ns = 0, -OVER_NS
        self._steps, self._step_at_ns = 0, -OVER_NS
        self._imu_at_ns = -OVER_NS
        self._imu = self._unfit = 0
        self._looks_shown: dict[str, int] = {}
        self._active: dict[str, Episode] = {}
        self._past: deque[Episode] = deque(maxlen=FORGOTTEN)
        self.surroundings: Callable[[], Surroundings] = Surroundings
        self.placed: PlacedScans | None = None
        self.undecoded = ""

    @property
    def active(self) -> list[Episode]:
        """The causes that are present, in the order of their beginning."""
        return list(self._active.values())

    @property
    def episodes(self) -> list[Episode]:
        """All causes so far, those that are over first."""
        return [*self._past, *self._active.values()]

    def note_start(self, now_ns: int) -> None:
        """Note that packets may come from now on."""
        if self._begun_ns is None:
            self._begun_ns = now_ns

    def note_packet(self, stamp_ns: int, arrival_ns: int) -> None:
        """Note a packet of points: the first of a batch, and each after a pause."""
        if self._last_ns is not None:
            gap_ns = arrival_ns - self._last_ns
            if gap_ns > GAP_NS and not 0 <= stamp_ns - self._stamp_ns < gap_ns - GAP_NS:
                self._gap_ns, self._gap_at_ns = gap_ns, arrival_ns
        self._last_ns, self._stamp_ns = arrival_ns, stamp_ns

    def note_unfit(self) -> None:
        """Note a packet of this maker that the decoder cannot use."""
        self._unfit += 1

    def add_returns(self, raw: RawReturns) -> None:
        """Use a batch of returns."""
        if self._signs is not None:
            self._picture.add(raw)

    def check(self, now_ns: int) -> None:
        """Look, if a quarter of a second has passed since the last look."""
        self.note_start(now_ns)
        if self._looked_ns is not None and 0 <= now_ns - self._looked_ns < LOOK_NS:
            return
        self._looked_ns = now_ns
        surroundings = self._watch(now_ns)
        self._looks.append(self._look(now_ns, surroundings))
        shown = self._shown(now_ns, surroundings)
        for cause in list(self._looks_shown):
            if cause not in shown:
                del self._looks_shown[cause]
        for cause, explanation in shown.items():
            self._looks_shown[cause] = self._looks_shown.get(cause, 0) + 1
            if any(other in shown or other in self._active for other in EXPLAINED_BY.get(cause, ())):
                continue
            if cause in self._active or self._looks_shown[cause] >= PATIENCE.get(cause, 1):
                self._sign(cause, explanation, now_ns)
        self._end(now_ns)

    # ---- looks ----------------------------------------------------------------------------------

    def _watch(self, now_ns: int) -> Surroundings:
        quiet = self._last_ns is None or now_ns - self._last_ns > SILENT_NS
        losing = len(self._looks) > 1 and self._looks[-1].lost > self._looks[-2].lost
        return self.surroundings() if quiet or losing or len(self._looks) <= SPAN else Surroundings()

    def _look(self, now_ns: int, surroundings: Surroundings) -> StreamLook:
        count = self._statistics()
        packets, lost, *_ = (int(count.get(name) or 0) for name in COUNTED)
        imu = int(count.get("imu") or 0)
        if imu != self._imu:
            self._imu, self._imu_at_ns = imu, now_ns
        if self._clock.steps != self._steps:
            self._steps, self._step_at_ns = self._clock.steps, now_ns
        dropped = surroundings.dropped
        if dropped is None:
            dropped = self._looks[-1].dropped if self._looks else 0
        signs, picture = self._signs or PacketSigns(), self._picture
        picture.look()
        return StreamLook(
            at_ns=now_ns,
            stamp_ns=self._stamp_ns,
            packets=packets,
            lost=lost,
            spoilt=spoilt_of(count),
            foreign=int(count.get("foreign") or 0),
            wrong_sensor=int(count.get("wrong_sensor") or 0),
            imu=imu,
            unfit=self._unfit,
            dropped=dropped,
            repeated=0 if self.placed is None else self.placed.repeated,
            covered_ns=signs.covered_ns,
            azimuth_packets=np.array(signs.azimuth_packets, np.int64),
            seen=picture.seen.copy(),
            near=picture.near.copy(),
            close=picture.close.copy(),
            lines=picture.lines.copy(),
        )

    def _shown(self, now_ns: int, surroundings: Surroundings) -> dict[str, Explanation]:
        """Return the causes that the newest looks show."""
        look = self._looks[-1].since(self._looks[0])
        since_ns = self._last_ns if self._last_ns is not None else self._begun_ns or now_ns
        patience_ns = SILENT_NS if self._last_ns is not None else START_NS
        if now_ns - since_ns > patience_ns and not look.packets:
            cause, why = self._why_silent(look, surroundings, now_ns)
            return {cause: why}
        return self._why_poor(look, now_ns) | self._why_late(look, now_ns)

    def _why_silent(self, look: StreamLook, around: Surroundings, now_ns: int) -> tuple[str, Explanation]:
        if look.wrong_sensor:
            return "other_maker", explain.other_maker(self.undecoded)
        if look.unfit:
            return "not_as_described", explain.not_as_described(self.undecoded, self._described)
        if look.spoilt:
            return "spoilt", explain.spoilt(1.0)
        if now_ns - self._imu_at_ns < SILENT_NS:
            return (
                ("wrong_port", explain.wrong_port()) if self._last_ns is None else ("muted", explain.muted())
            )
        if around.refused:
            return "refusal", explain.refusal(around.refused)
        if around.answers:
            return "firewall", explain.firewall()
        destination = self._signs.destination if self._signs else ""
        if destination and not is_ours(destination, around.bound):
            return "elsewhere", explain.elsewhere(destination, self._described)
        if around.present:
            return "elsewhere", explain.elsewhere("another host or port", self._described)
        return "silent", explain.silent(around.bound)

    def _why_poor(self, look: StreamLook, now_ns: int) -> dict[str, Explanation]:
        """Return causes by which something is missing or too much."""
        shown: dict[str, Explanation] = {}
        arrived = look.packets + look.spoilt + look.foreign
        if look.wrong_sensor >= LEAST_SPOILT:
            shown["other_maker"] = explain.other_maker(self.undecoded)
        if look.unfit >= LEAST_SPOILT and not look.packets:
            shown["not_as_described"] = explain.not_as_described(self.undecoded, self._described)
        elif look.spoilt - look.wrong_sensor >= max(LEAST_SPOILT, SPOILT_SHARE * arrived):
            shown["spoilt"] = explain.spoilt(look.spoilt / arrived)
        if look.foreign >= LEAST_SPOILT:
            shown["two_sensors"] = explain.two_sensors()
        if look.repeated:
            shown["repeats"] = explain.repeats()
        error_deg = None if self.placed is None else self.placed.mount_error_deg
        if error_deg is not None:
            shown["mount"] = explain.wrong_mount(*error_deg)
        if now_ns - self._gap_at_ns < SHOWN_NS:
            shown["pauses"] = explain.pauses(self._gap_ns * 1e-9)
        if len(self._looks) <= SPAN:
            return shown
        if look.lost >= LEAST_LOST and look.lost_share > LOSS:
            by_kernel = look.dropped >= max(1, look.lost // 2)
            told = explain.full_buffer if by_kernel else explain.missing_packets
            shown["full_buffer" if by_kernel else "missing_packets"] = told(look.lost_share)
        if self._signs is None:
            return shown
        span_ns = look.at_ns
        flows = all(later.packets > earlier.packets for earlier, later in pairwise(self._looks))
        if flows and look.covered_ns < LOW_RATE * span_ns and look.lost_share < (1 - LOW_RATE) / 2:
            shown["low_rate"] = explain.low_rate(look.covered_ns / span_ns, self._described)
        self._close.add(look)
        found = (
            ("missing_sector", picture_faults.missing_sector(look, self._signs)),
            ("dirty", picture_faults.dirty_window(look, self._close)),
            ("covered", picture_faults.covered_sector(look, self._usual, self._close)),
            ("dead_lines", picture_faults.dead_lines(look, self._looks[-1].lines, self._signs)),
        )
        shown |= {cause: why for cause, why in found if why is not None}
        if "covered" not in shown:
            self._usual += SETTLE * (look.seen - self._usual)
        return shown

    def _why_late(self, look: StreamLook, now_ns: int) -> dict[str, Explanation]:
        """Return causes in the clock."""
        shown: dict[str, Explanation] = {}
        if now_ns - self._step_at_ns < SHOWN_NS and self._steps:
            shown["step"] = explain.step(self._clock.last_step_ns * 1e-9)
        settled = now_ns - max(self._step_at_ns, self._gap_at_ns) > AFTER_STEP_NS
        ppm = self._clock.drift_ppm
        if settled and ppm is not None and DRIFT_PPM < abs(ppm) < MOST_PPM:
            shown["drift"] = explain.drift(ppm)
        wanted = WANTED.get(self._reference)
        if wanted is None:
            return shown
        clock = "" if self._signs is None else self._signs.clock
        if self._signs is not None and self._signs.pulse and wanted == "GPS":
            shown["no_pps"] = explain.no_pps(self._signs.pulse)
        elif clock == "free":
            shown["no_master"] = explain.no_master(wanted)
        elif getattr(self._clock, "keeps", None) is False:
            shown["other_master"] = explain.other_master()
        return shown

    # ---- episodes -------------------------------------------------------------------------------

    def _sign(self, cause: str, explanation: Explanation, now_ns: int) -> None:
        episode = self._active.get(cause)
        if episode is not None:
            episode.last_sign_ns = now_ns
            return
        self._active[cause] = Episode(cause, explanation, now_ns, last_sign_ns=now_ns)

    def _end(self, now_ns: int) -> None:
        for cause, episode in list(self._active.items()):
            if now_ns - episode.last_sign_ns > OVER_NS:
                del self._active[cause]
                episode.ended_ns = episode.last_sign_ns
                self._past.append(episode)
