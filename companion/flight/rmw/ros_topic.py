"""Topics, and their key expressions and liveliness tokens in rmw_zenoh's notation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ADMIN_SPACE = "@ros2_lv"
NODE_ID = 0
Kind = Literal["MP", "MS"]


# Of rmw/types.h; reliable, volatile and keep last are rmw_zenoh's defaults.
_BEST_EFFORT, _TRANSIENT_LOCAL = "2", "1"
_DEFAULT_DEPTH = 42


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service.

    depth: messages kept, the last ones. reliable: else best effort. transient_local: one who subscribes later
    gets the last messages too; else volatile.
    """

    depth: int
    reliable: bool = True
    transient_local: bool = False

    def token(self) -> str:
        """Return reliability, durability, history, deadline, lifespan and liveliness; defaults are empty."""
        reliability = "" if self.reliable else _BEST_EFFORT
        durability = _TRANSIENT_LOCAL if self.transient_local else ""
        depth = "" if self.depth == _DEFAULT_DEPTH else str(self.depth)
        return f"{reliability}:{durability}:,{depth}:,:,:,,"


SENSOR_DATA = Qos(5, reliable=False)
LATCHED = Qos(1, transient_local=True)


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic. name: with its leading slash. type: as `sensor_msgs/msg/PointCloud2`."""

    name: str
    type: str
    qos: Qos


@dataclass(frozen=True, slots=True)
class NodeName:
    """A node of a ROS graph. session: ID of its Zenoh session, lower-case hexadecimal."""

    domain: int
    session: str
    name: str

    def token(self) -> str:
        """Return the liveliness token of the node, without enclave and namespace."""
        return f"{ADMIN_SPACE}/{self.domain}/{self.session}/{NODE_ID}/{NODE_ID}/NN/%/%/{self.name}"

    def endpoint_token(self, topic: Topic, type_hash: str, entity: int, kind: Kind) -> str:
        """Return the liveliness token of a publisher ("MP") or a subscription ("MS") of the node."""
        return "/".join(
            (
                *(ADMIN_SPACE, str(self.domain), self.session, str(NODE_ID), str(entity), kind),
                *("%", "%", self.name, topic.name.replace("/", "%")),
                *(dds_type(topic.type), type_hash, topic.qos.token()),
            )
        )


def topic_key(domain: int, topic: Topic, type_hash: str) -> str:
    """Return the key expression of a topic's messages."""
    return f"{domain}/{topic.name.strip('/')}/{dds_type(topic.type)}/{type_hash}"


def dds_type(name: str) -> str:
    """Return the name of a type on the wire, as `std_msgs::msg::dds_::String_`."""
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"
