"""Where does slz land? A subscriber of its ROS 2 topic without ROS: Zenoh carries it, rosbags decodes it."""

import sys

import zenoh
from rosbags.typesys import Stores, get_typestore

router = sys.argv[1] if len(sys.argv) > 1 else "tcp/localhost:7447"  # that of slz run --ros2 zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{router}"]')
types = get_typestore(Stores.ROS2_JAZZY)

with zenoh.open(config) as session:
    # rmw_zenoh's keys are domain/topic/type/hash; the point is published while one is selected and safe.
    samples = session.declare_subscriber("*/slz/landing_point/**")
    message = types.deserialize_cdr(bytes(samples.recv().payload), "geometry_msgs/msg/PoseStamped")

at, time = message.pose.position, message.header.stamp
print(f"{at.x:.1f} m east, {at.y:.1f} m north, {at.z:.1f} m up in frame {message.header.frame_id!r}")
print(f"at {time.sec}.{time.nanosec:09d} s")
