"""Scan assembler: buffers returns until poses bracket them, then georeferences them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from companion.flight.fusion.boresight_check import BoresightCheck
from companion.flight.fusion.georeference import Georeferencer
from companion.flight.fusion.height_datum import HeightDatum
from companion.flight.fusion.odometry.place_source import PlaceSource
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.repeated_picture import RepeatedPicture, View
from companion.flight.fusion.vehicle_and_dust_filter import VehicleAndDustFilter
from companion.flight.sensors.returns import Returns, join
from params import Parameters
from slz import Scan, SpeckDetector

SPAN_NS = 50_000_000
# Limit of buffered returns and lost rays, some seconds of a fast sensor: bounds memory whatever stamps say.
MOST_WAITING = 2_000_000


class ScanAssembler:
    """Assembles returns into scans of 50 ms and georeferences them once poses bracket them.

    No return is placed by an extrapolated pose: a batch that no pose has followed within `pose_timeout_s`, by
    the sensor's own stamps, is dropped.

    Parameters
    ----------
    parameters
        Mount, range gate and `pose_timeout_s`.
    history
        Poses of the vehicle.
    on_scan
        Called with every scan, in order.
    specks
        Judge of each return, None to judge none, and to leave the height datum to another sensor's scans.
    odometry
        Follows the scans, and corrects the history's poses; None for none.

    Attributes
    ----------
    stale
        Returns dropped because no pose came in time or the buffer was full.
    scans
        Scans emitted.
    boresight
        Check of the stated mount by the scans.
    """

    def __init__(
        self,
        parameters: Parameters,
        history: PoseHistory,
        on_scan: Callable[[Scan], None],
        specks: SpeckDetector | None = None,
        odometry: PlaceSource | None = None,
    ) -> None:
        self._patience_ns = round(parameters.pose_timeout_s * 1e9)
        self._history = history
        self._on_scan = on_scan
        self._specks, self._epoch = specks, history.epoch
        self._height = None if specks is None else HeightDatum(history)
        self._odometry = odometry
        self._georeferencer = Georeferencer(parameters)
        self._filter = VehicleAndDustFilter(parameters)
        self._repeated = RepeatedPicture()
        self.boresight = BoresightCheck()
        self._waiting: deque[tuple[int, Returns]] = deque()  # with the newest stamp of each batch
        self._n_waiting = 0
        self._gathered: list[Returns] = []
        self.stale = 0
        self.scans = 0

    def add(self, returns: Returns) -> None:
        """Add a batch of returns; emit the scans that are now complete."""
        if not len(returns):
            return
        newest_ns = int(returns.stamp_ns.max())
        self._waiting.append((newest_ns, returns))
        self._n_waiting += len(returns) + len(returns.lost_ns)
        self._place_bracketed()
        self._drop_stale(newest_ns)

    def finish(self) -> None:
        """Place what waits and emit the open scan, as nothing follows; drop what no poses bracket."""
        self._place_bracketed()
        if self._gathered:
            self._emit()
        self.stale += sum(len(returns) for _, returns in self._waiting)
        self._waiting.clear()
        self._n_waiting = 0

    @property
    def repeated(self) -> int:
        """Number of returns of scans that repeated an earlier picture."""
        return self._repeated.returns

    @property
    def mount_error_deg(self) -> tuple[float, float] | None:
        """Roll and pitch by which the stated mount is certainly wrong, None where it is not."""
        return self.boresight.error_deg

    def statistics(self) -> dict[str, int]:
        """Return the counts of emitted scans and of dropped returns by reason."""
        return {
            "scans": self.scans,
            "stale": self.stale,
            "out_of_range": self._georeferencer.out_of_range,
            "without_pose": self._georeferencer.without_pose,
            "pitched": self._georeferencer.pitched,
            "repeated_picture": self.repeated,
            "vehicle": self._filter.vehicle,
            "dust": self._filter.dust,
            "specks": 0 if self._specks is None else self._specks.specks,
        }

    def _place_bracketed(self) -> None:
        until_ns = self._history.bracketed_until_ns
        while until_ns is not None and self._waiting and self._waiting[0][0] <= until_ns:
            newest_ns, returns = self._waiting.popleft()
            self._n_waiting -= len(returns) + len(returns.lost_ns)
            self._gather(returns, newest_ns)

    def _gather(self, returns: Returns, newest_ns: int) -> None:
        """Add a batch to the scan, which ends at a span of 50 ms or before a gap that would double it."""
        if self._gathered and not 0 <= newest_ns - int(self._gathered[0].stamp_ns[0]) < 2 * SPAN_NS:
            self._emit()
        self._gathered.append(returns)
        if newest_ns - int(self._gathered[0].stamp_ns[0]) >= SPAN_NS:
            self._emit()

    def _emit(self) -> None:
        returns = self._filter.filter(join(self._gathered))
        self._gathered = []
        if self._repeats(returns):
            return
        scan = self._georeferencer.georeference(returns, self._history)
        if scan is not None:
            self.scans += 1
            self.boresight.add(scan, self._history)
            for follower in (self._height, self._odometry):
                if follower is not None:
                    follower.add(scan)
            placed = self._history.correction_at(int(scan.stamp_ns[-1])).scan(scan)
            self._on_scan(self._judged(placed))

    def _repeats(self, returns: Returns) -> bool:
        """Return whether the LiDAR repeats what it saw in another view: it shows nothing of now."""
        newest_ns = int(returns.stamp_ns[-1]) if len(returns) else 0
        pose = self._history.interpolate(np.array([newest_ns]))
        if not pose.valid[0]:
            return False
        view = View(float(pose.position_enu_m[0, 2]), pose.rotation_enu_from_frd[0, 2])
        return self._repeated.is_repeated(returns.xyz_sensor_m, view, newest_ns)

    def _judged(self, scan: Scan) -> Scan:
        """Return a scan with the kinds of its returns, by rays since the last jump of the position."""
        if self._specks is None:
            return scan
        if self._history.epoch != self._epoch:
            self._epoch = self._history.epoch
            self._specks.forget()
        return replace(scan, kinds=self._specks.classify(scan))

    def _drop_stale(self, newest_ns: int) -> None:
        """Drop batches that waited too long or were stamped before the sensor's clock was set back."""
        while self._waiting and (
            abs(newest_ns - self._waiting[0][0]) > self._patience_ns or self._n_waiting > MOST_WAITING
        ):
            _, returns = self._waiting.popleft()
            self._n_waiting -= len(returns) + len(returns.lost_ns)
            self.stale += len(returns)
