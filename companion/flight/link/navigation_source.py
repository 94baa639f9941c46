"""Switch of ArduPilot's position source between GPS and the LiDAR odometry.

ArduPilot's estimator uses one source set at a time, EK3_SRC1_ or EK3_SRC2_, and does not change it by itself.
Without GPS its position fails after 7.3 s and its failsafe takes the mode after 8.1 s (measured, 4.7-dev),
whatever else it receives. PX4 fuses all that it gets, and needs no switch.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.link import Link
from companion.flight.link.vehicle_state import VehicleState
from companion.runtime.clock import now_ns

log = logging.getLogger(__name__)

GPS, LIDAR = 1, 2
# A receiver that has just found its satellites again may lose them, or err by metres at first.
GPS_GOOD_NS = 5_000_000_000
# The same while the LiDAR gives no position either.
GPS_GOOD_ALONE_NS = 1_000_000_000
# The autopilot's dead reckoning holds so long, see BRIDGE_NS of the LiDAR odometry.
UNHEALTHY_NS = 3_000_000_000
RETRY_NS = 1_000_000_000
TRIES_UNTIL_CALL = 2
TICK_S = 0.05
ANSWER_S, TRIES = 0.3, 3
Text = tuple[str, int]


class NavigationSource:
    """Decision which source set ArduPilot shall use; no I/O except in `run`.

    Parameters
    ----------
    place_by
        Name of the odometry in texts, "LiDAR" or "odometry".

    Attributes
    ----------
    active
        Source set that was last confirmed; an autopilot starts with `GPS`.
    """

    def __init__(self, place_by: str = "LiDAR") -> None:
        self._place_by = place_by
        self.active = GPS
        self._wanted = GPS
        self._good_since_ns: int | None = None
        self._unhealthy_since_ns: int | None = None
        self._asked_ns: int | None = None
        self._failures = 0
        self._called = False
        self._texts: list[Text] = []

    def update(self, gps_lost: bool, healthy: bool, now_ns: int) -> int | None:
        """Return the source set to command now, None for none.

        Parameters
        ----------
        gps_lost
            Whether the armed vehicle's receiver had a fix and has none.
        healthy
            Whether the odometry observes all axes, and its estimates are sent.
        """
        self._good_since_ns = None if gps_lost else self._good_since_ns or now_ns
        self._unhealthy_since_ns = None if healthy else self._unhealthy_since_ns or now_ns
        if gps_lost and healthy:
            self._want(LIDAR)
        elif not gps_lost and self._passed(self._good_since_ns, now_ns) > self._needed_ns():
            self._want(GPS)
        elif gps_lost and self._wanted == LIDAR and self.active == GPS:
            self._want(GPS)  # no longer worth switching to
        self._call_for_pilot(gps_lost, now_ns)
        if self._wanted == self.active or (self._asked_ns is not None and now_ns - self._asked_ns < RETRY_NS):
            return None
        self._asked_ns = now_ns
        return self._wanted

    def record_result(self, source: int, accepted: bool) -> None:
        """Record the answer to a command."""
        if accepted and source != self.active:
            self.active = source
            self._failures = 0
            if source == LIDAR:
                self._tell(f"SLZ: GPS lost: position from the {self._place_by}", mavlink.MAV_SEVERITY_WARNING)
            else:
                self._tell("SLZ: GPS back: position from GPS", mavlink.MAV_SEVERITY_NOTICE)
        elif not accepted:
            self._failures += 1
            if self._failures == TRIES_UNTIL_CALL and source == LIDAR:
                self._tell(
                    f"SLZ: {self._place_by} position refused: take over", mavlink.MAV_SEVERITY_CRITICAL
                )
            elif self._failures == TRIES_UNTIL_CALL:
                self._tell("SLZ: GPS back, its use refused", mavlink.MAV_SEVERITY_WARNING)

    def forget(self) -> None:
        """Begin anew after a reboot of the autopilot, which starts with the first source set."""
        self.active = self._wanted = GPS
        self._asked_ns, self._failures = None, 0

    def pop_texts(self) -> list[Text]:
        """Return the new texts for the pilot with their severities, and clear them."""
        texts, self._texts = self._texts, []
        return texts

    async def run(
        self,
        link: Link,
        healthy: Callable[[], bool],
        parameters: Callable[[], Mapping[str, float]],
    ) -> None:
        """Switch until cancelled.

        Parameters
        ----------
        parameters
            The autopilot's parameters as last read, by name.
        """
        forget = link.inbox.on_reboot.subscribe(self.forget)
        try:
            while True:
                await asyncio.sleep(TICK_S)
                if not link.connected or not can_switch(link.vehicle, parameters()):
                    continue
                lost = link.vehicle.armed and link.vehicle.health.fix_lost
                source = self.update(lost, healthy(), now_ns())
                if source is not None:
                    await self._command(link, source)
                for text, severity in self.pop_texts():
                    log.info(text)
                    link.statustext(text, severity)
        finally:
            forget()

    async def _command(self, link: Link, source: int) -> None:
        result = await link.command(
            mavlink.MAV_CMD_SET_EKF_SOURCE_SET, float(source), timeout_s=ANSWER_S, tries=TRIES
        )
        self.record_result(source, result.ok)

    def _want(self, source: int) -> None:
        if source != self._wanted:
            self._wanted, self._asked_ns, self._failures = source, None, 0

    def _needed_ns(self) -> int:
        return GPS_GOOD_NS if self._unhealthy_since_ns is None else GPS_GOOD_ALONE_NS

    def _call_for_pilot(self, gps_lost: bool, now_ns: int) -> None:
        """Call once when the vehicle that flies by the odometry has lost it."""
        lost = gps_lost and self.active == LIDAR
        if not lost or self._unhealthy_since_ns is None:
            self._called = False
        elif not self._called and self._passed(self._unhealthy_since_ns, now_ns) > UNHEALTHY_NS:
            self._called = True
            self._tell(f"SLZ: no GPS, no {self._place_by} position: take over", mavlink.MAV_SEVERITY_CRITICAL)

    def _tell(self, text: str, severity: int) -> None:
        self._texts.append((text, severity))

    @staticmethod
    def _passed(since_ns: int | None, now_ns: int) -> int:
        return 0 if since_ns is None else now_ns - since_ns


def can_switch(vehicle: VehicleState, parameters: Mapping[str, float]) -> bool:
    """Return whether the autopilot needs the switch, and its second source set is the odometry."""
    source = vehicle.autopilot.second_source
    return bool(source) and all(parameters.get(name) == value for name, value in source.items())
