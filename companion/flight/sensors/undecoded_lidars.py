"""LiDARs that are recognised by their packets, and for which there is no decoder.

Sources: Velodyne's factory byte (user manual 63-9243); first bytes and sizes of Hesai's packets (user manuals
of Pandar40P, 64, 128, QT and XT); RoboSense's MSOP identifiers (user manuals of RS-16, Helios and M1); Livox
SDK communication protocol of the first generation.
"""

from __future__ import annotations

WAY = (
    "let the maker's ROS 2 driver publish its clouds, and give those: --lidar ros2:/TOPIC in flight, a bag of"
    " them to slz replay"
)
VELODYNE_BYTES, VELODYNE_FLAG = 1206, b"\xff\xee"
VELODYNE_BLOCK = 100
LOWER_BLOCK = b"\xff\xdd"  # of an HDL-64E and of a VLS-128, which have more lasers than a block
DECODED = frozenset({0x22, 0x24, 0x28})  # factory bytes of VLP-16, Puck Hi-Res, VLP-32C
VELODYNES = {0x21: "HDL-32E", 0x23: "Puck LITE", 0x31: "Velarray", 0xA1: "VLS-128"}
HESAI_START = b"\xee\xff"
# Lasers and blocks of a packet, in its bytes 6 and 7.
HESAIS = {
    (40, 10): "Pandar40P", (64, 6): "Pandar64", (64, 4): "PandarQT", (16, 8): "PandarXT-16",
    (32, 8): "PandarXT-32", (32, 6): "PandarXT-32M", (128, 2): "of 128 lasers",
}  # fmt: skip
PANDAR40_BYTES = frozenset({1256, 1260, 1262, 1266})  # begins with a block, as a Velodyne's
ROBOSENSES = (b"\x55\xaa\x05\x0a\x5a\xa5\x50\xa0", b"\x55\xaa\x05\x5a", b"\x55\xaa\x5a\xa5")
LIVOX_VERSION = 5  # of the first generation
# Bytes of a point by data type, and points of a packet.
LIVOX_POINTS = {0: (13, 100), 1: (9, 100), 2: (14, 96), 3: (10, 96), 4: (28, 48), 5: (16, 48)}
LIVOX_HEAD = 18


def undecoded_lidar(packet: bytes) -> str | None:
    """Return maker and model of a LiDAR without a decoder that seems to have sent a packet, else None."""
    if packet.startswith(VELODYNE_FLAG):
        return _velodyne(packet)
    if packet.startswith(HESAI_START) and len(packet) > 100:
        model = HESAIS.get((packet[6], packet[7]))
        return "a Hesai LiDAR" if model is None else f"a Hesai LiDAR {model}"
    if packet.startswith(ROBOSENSES):
        return "a RoboSense LiDAR"
    if len(packet) > LIVOX_HEAD and packet[0] == LIVOX_VERSION:
        size, points = LIVOX_POINTS.get(packet[9], (0, 0))
        if size and len(packet) == LIVOX_HEAD + size * points:
            return "a Livox of the first generation (Mid-40, Mid-70, Horizon, Avia or Tele-15)"
    return None


def _velodyne(packet: bytes) -> str | None:
    if len(packet) in PANDAR40_BYTES:
        return "a Hesai LiDAR Pandar40P"
    if len(packet) != VELODYNE_BYTES or packet[-1] in DECODED:
        return None
    model = VELODYNES.get(packet[-1])
    if model is None and packet[VELODYNE_BLOCK : VELODYNE_BLOCK + 2] == LOWER_BLOCK:
        model = "HDL-64E"
    if model is None:
        return f"a Velodyne of an unknown model (factory byte 0x{packet[-1]:02x})"
    return f"a Velodyne {model}"
