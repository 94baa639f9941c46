"""Returns of real recordings, and of simulated sensors, through the project's own packet decoders."""

from __future__ import annotations

import os
from pathlib import Path

import dpkt
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from companion.flight.sensors.decoders.ouster_decoder import OusterDecoder
from companion.flight.sensors.decoders.velodyne_decoder import VelodyneDecoder
from companion.flight.sensors.returns import RawReturns
from tests import REPOSITORY

DATA = Path(os.environ.get("SLZ_DATA", REPOSITORY.parent / "shared/data"))
OUSTER = "ouster_os0/OS-0-128-U1_v2.3.0_1024x10"
_MESSAGES = {
    "velodyne_msgs/msg/VelodynePacket": "builtin_interfaces/Time stamp\nuint8[1206] data\n",
    "velodyne_msgs/msg/VelodyneScan": "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n",
}


def velodyne() -> RawReturns:
    """Return 0.4 s of a VLP-16 in dual mode."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _MESSAGES.items():
        store.register(get_types_from_msg(text, name))
    with Reader(DATA / "velodyne_vlp16") as reader:
        scans = [store.deserialize_cdr(raw, c.msgtype) for c, _, raw in reader.messages()]
    return VelodyneDecoder().decode([bytes(packet.data) for scan in scans for packet in scan.packets])


def ouster() -> RawReturns:
    """Return one turn of an OS-0-128, with ranges of 8 mm steps."""
    decoder = OusterDecoder((DATA / f"{OUSTER}.json").read_text())
    with (DATA / f"{OUSTER}.pcap").open("rb") as file:
        frames = [dpkt.ethernet.Ethernet(data) for _, data in dpkt.pcap.Reader(file)]
    return decoder.decode([bytes(frame.data.data.data) for frame in frames])
