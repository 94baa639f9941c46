"""What the kernel knows of a sensor: dropped packets and neighbours."""

from __future__ import annotations

from pathlib import Path

from companion.flight.sensors.diagnosis import explanation
from companion.flight.sensors.diagnosis.picture_faults import longest_run
from companion.flight.sensors.diagnosis.sensor_surroundings import is_ours, is_present
from companion.flight.sensors.udp_lidar import dropped_packets
from tests.unit.companion.flight.sensors.diagnosis.streams import np

HEAD = "sl local_address rem_address st tx_queue:rx_queue tr:tm->when retrnsmt uid timeout inode drops"
ROW = "00000000:0000 07 00000000:00034E00 00:00000000 00000000 0 0 11111 2 0000000000000000"
UDP = f"{HEAD}\n519: 00000000:DBED {ROW} 27\n520: 00000000:0940 {ROW} 3\n"
ARP = """\
IP address       HW type     Flags       HW address            Mask     Device
192.168.1.100    0x1         0x2         f0:0d:f0:0d:f0:0d     *        eth0
192.168.1.101    0x1         0x0         00:00:00:00:00:00     *        eth0
"""


def test_dropped_packets_are_those_of_the_port(tmp_path: Path) -> None:
    table = tmp_path / "udp"
    table.write_text(UDP)
    assert dropped_packets(56301, [table]) == 27
    assert dropped_packets(2368, [table, table]) == 6
    assert dropped_packets(7502, [table]) is None
    assert dropped_packets(2368, [tmp_path / "none"]) is None


def test_a_neighbour_is_present_if_its_entry_is_complete(tmp_path: Path) -> None:
    table = tmp_path / "arp"
    table.write_text(ARP)
    assert is_present("192.168.1.100", table) is True
    assert is_present("192.168.1.101", table) is False
    assert is_present("192.168.1.10", table) is None
    assert is_present("192.168.1.100", tmp_path / "none") is None


def test_destinations_that_reach_this_computer() -> None:
    assert is_ours("127.0.0.1")
    assert is_ours("255.255.255.255")
    assert not is_ours("198.51.100.7")


def test_multicasts_arrive_at_their_group_and_broadcasts_where_all_addresses_are_bound() -> None:
    assert not is_ours("239.1.1.5")
    assert not is_ours("239.1.1.5", "127.0.0.1")
    assert is_ours("239.1.1.5", "239.1.1.5")
    assert is_ours("255.255.255.255", "::")
    assert not is_ours("255.255.255.255", "127.0.0.1")
    assert not is_ours("127.0.0.2", "127.0.0.1")
    assert is_ours("127.0.0.1", "127.0.0.1")


def test_silence_at_one_address_names_the_one_where_broadcasts_arrive() -> None:
    assert "0.0.0.0" not in explanation.silent().remedy
    assert "use 0.0.0.0 or the group's address" in explanation.silent("192.168.1.50").remedy
    assert "--lidar KIND:239.1.1.5:PORT" in explanation.elsewhere("239.1.1.5").remedy


def test_a_run_may_pass_the_seam() -> None:
    marks = np.zeros(36, bool)
    assert longest_run(marks) is None
    marks[[34, 35, 0, 10, 11]] = True
    assert longest_run(marks) == (34, 3)
    assert longest_run(np.ones(36, bool)) == (0, 36)
