"""Is a point of mine safe to land at? Let slz watch it, by MAV_CMD_USER_1, in flight."""

import sys

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

url = sys.argv[1] if len(sys.argv) > 1 else "udpin:127.0.0.1:14550"  # where the vehicle's messages arrive
link = mavutil.mavlink_connection(url, source_system=255)
link.wait_heartbeat()
here = link.recv_match(type="GLOBAL_POSITION_INT", blocking=True)
north_deg = 5 / 111_000  # the point: 5 m north of the vehicle
system, COMPANION = here.get_srcSystem(), 191

# Order 3: land at the point if parameter 2 is 1, only watch it if it is 0.
link.mav.command_int_send(
    *(system, COMPANION, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_USER_1, 0, 0),
    *(3, 0, 0, 0),
    *(here.lat + round(north_deg * 1e7), here.lon, here.alt / 1000),
)
while (answer := link.recv_match(type="COMMAND_ACK", blocking=True)).command != mavlink.MAV_CMD_USER_1:
    pass
print(mavlink.enums["MAV_RESULT"][answer.result].name)

# The companion says once a second what the point is; "unknown" until enough of the ground was seen.
for _ in range(60):
    while (message := link.recv_match(type="NAMED_VALUE_FLOAT", blocking=True)).name != "SLZ_POINT":
        pass
    state = ("none", "safe", "unsafe", "unknown")[int(message.value)]
    if state in ("safe", "unsafe"):
        break
print(f"the point is {state}")
