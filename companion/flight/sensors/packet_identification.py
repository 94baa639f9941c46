"""Packet identification: a guess of the maker of a datagram, to report a wrong URL, not to decode."""

from __future__ import annotations

LIVOX_POINT_BYTES = {0: 24, 1: 14, 2: 8, 3: 10}
LIVOX_HEADER_BYTES = 36
VELODYNE_BYTES, VELODYNE_FLAG, VELODYNE_BLOCK = 1206, b"\xff\xee", 100
OUSTER_COLUMNS = 16
OUSTER_ROWS = (16, 32, 64, 128)
# Bytes of a pixel in the profiles LEGACY, RNG15_RFL8_NIR8, RNG19_RFL8_SIG16_NIR16, and the dual and FUSA
# ones.
OUSTER_LEGACY_PIXEL, OUSTER_PIXELS = 12, (4, 8, 12, 16)
OUSTER_PACKET_TYPE = b"\x01\x00"

OWN = {b"SLZF": "flash", b"SLZR": "radar"}
NAMES = {"livox": "a Livox Mid-360", "velodyne": "a Velodyne", "ouster": "an Ouster"} | {
    "flash": "a flash LiDAR",
    "radar": "an interferometric radar",
}


def identify_packet(packet: bytes) -> str | None:
    """Return the kind of sensor, as in its URL, that seems to have sent a packet, None if unknown."""
    if packet[:4] in OWN:
        return OWN[packet[:4]]
    if _is_livox(packet):
        return "livox"
    if _is_velodyne(packet):
        return "velodyne"
    if _is_ouster(packet):
        return "ouster"
    return None


def is_points(packet: bytes, kind: str) -> bool:
    """Return whether a packet of this kind of sensor has the form of points, not of a status."""
    return kind != "velodyne" or len(packet) == VELODYNE_BYTES


def _is_livox(packet: bytes) -> bool:
    if len(packet) < LIVOX_HEADER_BYTES or packet[0] or int.from_bytes(packet[1:3], "little") != len(packet):
        return False
    size = LIVOX_POINT_BYTES.get(packet[10])
    points = int.from_bytes(packet[5:7], "little")
    return size is not None and len(packet) == LIVOX_HEADER_BYTES + points * size


def _is_velodyne(packet: bytes) -> bool:
    if len(packet) == 512:
        return packet[206:209] == b"$GP"
    return (
        len(packet) == VELODYNE_BYTES
        and packet.startswith(VELODYNE_FLAG)
        and packet[1100:1102]
        in (
            VELODYNE_FLAG,
            b"\xff\xdd",
            b"\xff\xcc",
            b"\xff\xbb",
        )
    )


def _is_ouster(packet: bytes) -> bool:
    for rows in OUSTER_ROWS:
        if len(packet) == OUSTER_COLUMNS * (16 + rows * OUSTER_LEGACY_PIXEL + 4):
            return True
        if packet.startswith(OUSTER_PACKET_TYPE) and len(packet) in (
            64 + OUSTER_COLUMNS * (12 + rows * pixel) for pixel in OUSTER_PIXELS
        ):
            return True
    return False
