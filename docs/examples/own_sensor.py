"""How does slz get a new LiDAR? `python own_sensor.py run --mavlink URL --lidar toy:0.0.0.0:7700`"""

from dataclasses import make_dataclass

import numpy as np

from companion.cli.program import main
from companion.flight.sensors.returns import RawReturns
from companion.flight.sensors.sensor_registry import add_sensor

COUNTERS = make_dataclass("Counters", ["packets", "malformed", "lost_packets", "returns", "no_return"])
POINT = np.dtype([("time_us", "<u4"), ("xyz_mm", "<i4", 3), ("intensity", "u1")])


class ToyDecoder(list):  # of packets that wait: b"TOY1", then points, x forward, y right, z down
    kind, metadata, add_packet = "toy", "", list.append

    def __init__(self):
        self.counters = COUNTERS(0, 0, 0, 0, 0)

    def check(self, packet):  # returns the time of the last point, ns; whatever arrives, nothing raises
        whole = packet[:4] == b"TOY1" and len(packet) > 4 and (len(packet) - 4) % POINT.itemsize == 0
        self.counters.malformed += not whole
        return 1000 * int(np.frombuffer(packet, POINT, offset=4)["time_us"][-1]) if whole else None

    def drain(self):
        points = np.frombuffer(b"".join(packet[4:] for packet in self), POINT)
        seen = points[points["xyz_mm"].any(axis=1)]  # zeros: the pulse did not come back
        self.counters.packets += len(self)
        self.counters.returns += len(seen)
        self.counters.no_return += len(points) - len(seen)
        self.clear()
        forward_left_up_m = (seen["xyz_mm"] * (0.001, -0.001, -0.001)).astype(np.float32)
        time_ns, ring_and_echoes = 1000 * seen["time_us"].astype(np.int64), np.ones((3, len(seen)), np.uint8)
        return RawReturns(forward_left_up_m, time_ns, seen["intensity"].copy(), *ring_and_echoes)


if __name__ == "__main__":
    add_sensor("toy", ToyDecoder, default_port=7700)
    main()
