"""Catalogue of causes: short text for the pilot, sentence and remedy for doctor and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from companion.flight.link.transport.multicast import is_multicast
from companion.flight.sensors.diagnosis.sensor_surroundings import ANY, ANY_6
from companion.flight.sensors.undecoded_lidars import WAY

Level = Literal["fail", "warn"]

SUBNET = "check power and cable, and that sensor and computer are in one subnet"
NETWORK = "use a wired network of its own with 1 Gbit/s, and check plugs and cable"
BUFFER = "run `sysctl -w net.core.rmem_max=8388608` and give the program more of the processor"
MASTER = "give sensor and computer one master (ptp4l and phc2sys, or chrony by GPS), or set lidar_clock=free"
GPRMC = "check the PPS wire and the GPRMC sentence: 1 Hz, whole seconds, valid checksum; or disconnect both"
REFETCH = "fetch its metadata again"
CLEAN = "clean the window; if a part of the vehicle is so near, move it or the sensor"


@dataclass(frozen=True, slots=True)
class Explanation:
    """Cause in words.

    Attributes
    ----------
    text
        For STATUSTEXT, at most 45 characters.
    sentence
        What was seen, and its cause.
    remedy
        What to do.
    level
        'fail' where the sensor is useless by it, 'warn' where the map is merely poorer.
    """

    text: str
    sentence: str
    remedy: str
    level: Level = "warn"

    @property
    def line(self) -> str:
        """Cause and remedy in one sentence."""
        return f"{self.sentence}: {self.remedy}"


# ---- nothing that can be used arrives --------------------------------------------------------------


def silent(bound: str = ANY) -> Explanation:
    """Nothing arrives any more, or has never arrived, at the bound address."""
    other = (
        ""
        if bound in (ANY, ANY_6)
        else f"; if it sends broadcasts or to a group, use {ANY} or the group's address"
    )
    return Explanation(
        "LiDAR silent: power, cable or address",
        "nothing comes from the LiDAR",
        f"{SUBNET}, and set the sensor's destination to this computer and the port of --lidar{other}",
        "fail",
    )


def elsewhere(address: str, described: bool = False) -> Explanation:
    """The sensor is alive, but sends to another host or group; described: by its metadata."""
    group = f", or receive from its group (--lidar KIND:{address}:PORT)" if is_multicast(address) else ""
    by = f"udp_dest{group}, and {REFETCH}" if described else f"`?sensor=` in --lidar sets a Mid-360's{group}"
    return Explanation(
        "LiDAR sends elsewhere: set its host address",
        f"the LiDAR is there, but sends to {address}",
        f"set the sensor's destination to this computer's address: {by}",
        "fail",
    )


def firewall() -> Explanation:
    """The sensor obeys commands, but its points do not arrive."""
    return Explanation(
        "LiDAR answers, no points: firewall or port",
        "the LiDAR answers commands and was told to send here, but no point arrives",
        "allow UDP from the sensor in this computer's firewall (`ufw allow from SENSOR`), and let no other"
        " program set the sensor",
        "fail",
    )


def refusal(why: str) -> Explanation:
    """The sensor refuses to be set up."""
    return Explanation(
        "LiDAR refuses its settings: update firmware",
        why,
        "update the sensor's firmware, or set its destination by the maker's program and leave out"
        " `?sensor=`",
        "fail",
    )


def wrong_port() -> Explanation:
    """Only inertial samples arrive, from the beginning."""
    return Explanation(
        "LiDAR sends no points here: wrong port",
        "the LiDAR's inertial samples arrive, but none of its points ever did",
        "set its point data port to that of --lidar, and start its sampling",
        "fail",
    )


def muted() -> Explanation:
    """Points stop while inertial samples go on."""
    return Explanation(
        "LiDAR points stopped, its IMU goes on: GPRMC?",
        "the LiDAR's points stopped while its inertial samples go on, as a Mid-360's do after an illegal"
        " GPRMC",
        GPRMC,
        "fail",
    )


def other_maker(undecoded: str = "") -> Explanation:
    """Packets of another maker arrive; undecoded: that LiDAR, if there is no decoder for it."""
    sender = undecoded or "another maker's LiDAR"
    return Explanation(
        "another maker's LiDAR sends to this port",
        f"what arrives are packets of {sender}",
        f"there is no decoder for it: {WAY}"
        if undecoded
        else "name that maker in --lidar, or let it send to another port",
        "fail",
    )


def not_as_described(undecoded: str = "", described: bool = False) -> Explanation:
    """Packets of this maker, but not of this model or setting.

    undecoded: the model without a decoder. described: its metadata say the setting.
    """
    return Explanation(
        "LiDAR packets do not fit: model or setting",
        f"what arrives are packets of {undecoded}"
        if undecoded
        else "packets of this maker arrive, but not of this model, firmware or setting",
        f"there is no decoder for it: {WAY}"
        if undecoded
        else f"{REFETCH} after each change of its settings"
        if described
        else "see which models and settings docs/sensors.md lists",
        "fail",
    )


def spoilt(share: float) -> Explanation:
    """Damaged packets."""
    return Explanation(
        "LiDAR packets spoilt: cable or port shared",
        f"{100 * share:.0f} % of what arrives is damaged",
        "check plugs and cable, see that nothing else sends to this port, and update the sensor's firmware",
    )


def two_sensors() -> Explanation:
    """Packets of a second sensor."""
    return Explanation(
        "two LiDARs send to one port",
        "a second LiDAR sends to the same port, and its packets are dropped",
        "give it another port, or name the sensor by `?sensor=`",
    )


def repeats() -> Explanation:
    """One picture again and again, with new stamps."""
    return Explanation(
        "LiDAR repeats one picture: restart it",
        "the LiDAR sends the same returns again, with new stamps, while the vehicle moves: they show nothing"
        " of now and are not used",
        "restart the sensor; if it does so again, update its firmware or replace it",
        "fail",
    )


def wrong_mount(roll_deg: float, pitch_deg: float) -> Explanation:
    """The ground tilts with the vehicle's heading."""
    axis, error_deg = ("roll", roll_deg) if abs(roll_deg) > abs(pitch_deg) else ("pitch", pitch_deg)
    return Explanation(
        f"LiDAR mount looks wrong by {abs(error_deg):.0f} deg in {axis}",
        "the same ground tilts with the vehicle's heading, as by a mount that is told wrong by"
        f" {roll_deg:+.1f} degrees in the vehicle's roll and {pitch_deg:+.1f} in its pitch",
        "compare lidar_roll_deg, lidar_pitch_deg and lidar_yaw_deg with the mount, or run `slz calibrate` on"
        " a recording of this flight",
    )


# ---- something is missing --------------------------------------------------------------------------


def pauses(seconds: float) -> Explanation:
    """The stream stopped and went on."""
    return Explanation(
        f"LiDAR paused for {seconds:.1f} s",
        f"the LiDAR sent nothing for {seconds:.1f} s",
        "check its power supply (18 W at a Mid-360's start) and plugs; with PPS, its GPRMC; update its"
        " firmware",
    )


def missing_packets(share: float) -> Explanation:
    """Packets are lost on the way."""
    return Explanation(
        f"LiDAR packets missing: {100 * share:.0f} %, network",
        f"{100 * share:.0f} % of the LiDAR's packets are missing on the network",
        NETWORK,
    )


def full_buffer(share: float) -> Explanation:
    """The kernel drops packets because the program does not read them in time."""
    return Explanation(
        "LiDAR packets missing: receive buffer full",
        f"{100 * share:.0f} % of the LiDAR's packets are missing, because the kernel's receive buffer is"
        " full",
        BUFFER,
    )


def low_rate(share: float, described: bool = False) -> Explanation:
    """The sensor sends less than it says; described: in its metadata."""
    again = f" ({REFETCH})" if described else ""
    return Explanation(
        f"LiDAR sends only {100 * share:.0f} % of its rate",
        f"the LiDAR sends {100 * share:.0f} % of the rate that it states, and no packet is missing",
        f"set its frame rate and mode as stated{again}, and see that it is not hot or in a power-saving mode",
    )


def missing_sector(from_deg: float, to_deg: float) -> Explanation:
    """The sensor does not measure a part of the circle."""
    return Explanation(
        f"LiDAR sector missing: {from_deg:.0f} to {to_deg:.0f} deg",
        f"the LiDAR sends nothing of its azimuths {from_deg:.0f} to {to_deg:.0f} degrees",
        "set its field of view (azimuth window) to the full circle",
    )


def missing_rows(rows: Sequence[int]) -> Explanation:
    """Lasers that see nothing while their neighbours do."""
    named = ", ".join(str(row) for row in rows)
    return Explanation(
        f"LiDAR laser rows dead: {named}"[:45],
        f"the LiDAR's laser rows {named} see nothing while those beside them do",
        "clean the window; if that does not help, the sensor is defective",
    )


def covered(from_deg: float, to_deg: float) -> Explanation:
    """A sector without a single return, between sectors that have them."""
    return Explanation(
        f"LiDAR blind from {from_deg:.0f} to {to_deg:.0f} deg: covered?",
        f"the LiDAR sees nothing any more from {from_deg:.0f} to {to_deg:.0f} degrees of its azimuth,"
        " but beside that it does",
        "see what covers its window there, or whether there is only water",
    )


def dirty(from_deg: float, to_deg: float) -> Explanation:
    """Returns of the window itself."""
    return Explanation(
        f"LiDAR window dirty: {from_deg:.0f} to {to_deg:.0f} deg",
        f"many returns come from the LiDAR's window itself, from {from_deg:.0f} to {to_deg:.0f} degrees of"
        " its azimuth",
        CLEAN,
    )


# ---- its clock -------------------------------------------------------------------------------------


def no_master(source: str) -> Explanation:
    """The sensor follows nothing, though lidar_clock says so."""
    return Explanation(
        f"LiDAR clock runs free: no {source} master",
        f"lidar_clock is {source}, but by its packets the LiDAR's clock runs free: it hears no master",
        MASTER if source == "PTP" else GPRMC,
    )


def no_pps(state: str) -> Explanation:
    """No usable pulse or sentence at the sensor."""
    return Explanation(
        f"LiDAR clock without GPS: {state}",
        f"the LiDAR's clock does not follow GPS: {state}",
        GPRMC,
    )


def other_master() -> Explanation:
    """Sensor and computer follow different clocks."""
    return Explanation(
        "LiDAR clock is not this computer's",
        "the LiDAR's clock departs from this computer's by more than 1 ms: its master is another one, or gone"
        " (a Mid-360 goes on to say PTP)",
        MASTER,
    )


def step(step_s: float) -> Explanation:
    """The sensor's clock was set."""
    way = "forward" if step_s > 0 else "back"
    return Explanation(
        f"LiDAR clock stepped {way} by {_seconds(abs(step_s))}",
        f"the LiDAR's clock was set {way} by {_seconds(abs(step_s))}",
        "start the master before the flight and let nothing set it in flight; see that the sensor does not"
        " restart (power)",
    )


def drift(ppm: float) -> Explanation:
    """The sensor's clock runs too fast or too slowly."""
    way = "fast" if ppm > 0 else "slow"
    return Explanation(
        f"LiDAR clock {way} by {abs(ppm):.0f} ppm",
        f"the LiDAR's clock runs {way} by {abs(ppm):.0f} millionths, more than any oscillator",
        "see that only one PTP master is on the network, and that nothing slews this computer's clock",
    )


def _seconds(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1 else f"{1000 * seconds:.0f} ms"
