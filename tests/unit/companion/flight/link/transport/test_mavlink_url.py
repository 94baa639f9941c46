"""URLs in pymavlink's notation; faults in one line."""

from __future__ import annotations

import pytest

from companion.flight.link.transport.mavlink_url import Url, parse_url
from companion.runtime.errors import UsageError


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin:0.0.0.0:14550", Url("udpin", "0.0.0.0", 14550)),
        ("udp:127.0.0.1:14551", Url("udpin", "127.0.0.1", 14551)),
        ("udpin::14550", Url("udpin", "0.0.0.0", 14550)),
        ("udpout:drone.local:14550", Url("udpout", "drone.local", 14550)),
        ("tcp:127.0.0.1:5760", Url("tcp", "127.0.0.1", 5760)),
        ("tcpin:[::1]:5760", Url("tcpin", "::1", 5760)),
        ("/dev/ttyAMA0,921600", Url("serial", device="/dev/ttyAMA0", baud=921600)),
        ("serial:/dev/ttyS1:57600", Url("serial", device="/dev/ttyS1", baud=57600)),
        (" /dev/serial/by-id/usb-x ", Url("serial", device="/dev/serial/by-id/usb-x", baud=115200)),
    ],
)
def test_every_form_is_read_and_written_back(text: str, url: Url) -> None:
    assert parse_url(text) == url
    assert parse_url(str(url)) == url


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "it is empty"),
        ("http://127.0.0.1:80", "'http' is no known kind of link"),
        ("udpin:14550", "udpin needs a host and a port"),
        ("tcp::5760", "the host is missing"),
        ("tcp:127.0.0.1:99999", "port '99999' is not a number from 1 to 65535"),
        ("udpin:0.0.0.0:0", "port '0'"),
        ("tcp:127.0.0.1:0000099999", "port '0000099999'"),
        ("udpin:0.0.0.0:٣", "port '٣'"),
        ("tcp:127.0.0.1:", "port ''"),
        ("/dev/ttyAMA0,fast", "baud rate 'fast'"),
        ("serial:ttyS1:57600", "serial:/dev/NAME:BAUD"),
        ("tcp:::1:5760", "tcp needs a host and a port"),
    ],
)
def test_a_fault_is_one_line_with_the_text_the_fault_and_an_example(text: str, fault: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_url(text)
    line = str(caught.value)
    assert repr(text) in line
    assert fault in line
    assert "tcp:127.0.0.1:5760" in line
    assert "\n" not in line
