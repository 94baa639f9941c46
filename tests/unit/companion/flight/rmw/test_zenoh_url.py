"""The option --ros2."""

from __future__ import annotations

import pytest

from companion.flight.rmw.zenoh_url import ZenohUrl, parse_zenoh_url
from companion.runtime.errors import UsageError


def test_router_and_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert parse_zenoh_url("zenoh") == ZenohUrl("tcp/localhost:7447", 0)
    assert parse_zenoh_url("zenoh:tcp/10.0.0.2:7448") == ZenohUrl("tcp/10.0.0.2:7448", 0)
    assert parse_zenoh_url("zenoh:tcp/[::1]:7447?domain=7") == ZenohUrl("tcp/[::1]:7447", 7)
    assert parse_zenoh_url("zenoh?domain=7&distro=humble") == ZenohUrl(domain=7, has_hashes=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert parse_zenoh_url("zenoh").domain == 42
    assert parse_zenoh_url("zenoh?domain=3").domain == 3


@pytest.mark.parametrize(
    "text",
    [
        *("", "dds", "zenoh:", "zenoh:10.0.0.2:7447", "zenoh:tcp/10.0.0.2", "zenoh:tcp/10.0.0.2:0"),
        *("zenoh:tcp/10.0.0.2:65536", "zenoh?domain=", "zenoh?domain=233", "zenoh?domain=-1"),
        *("zenoh?distro=jazzy", "zenoh?name=1", "zenoh:tcp/a b:7447", "zenoh?domain=²"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text: str) -> None:
    with pytest.raises(UsageError) as said:
        parse_zenoh_url(text)
    assert "--ros2" in str(said.value)
    assert "\n" not in str(said.value)
