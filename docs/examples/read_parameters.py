"""Which parameters does slz have on this vehicle? Read them as a ground station does, by MAVLink."""

import sys

from pymavlink import mavutil

url = sys.argv[1] if len(sys.argv) > 1 else "udpin:127.0.0.1:14550"  # where the vehicle's messages arrive
link = mavutil.mavlink_connection(url, source_system=255)
system = link.wait_heartbeat().get_srcSystem()
COMPANION = 191  # component ID of slz, on the vehicle's own system

link.mav.param_request_list_send(system, COMPANION)
values, count = {}, None
while len(values) != count:
    message = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=5)
    if message is None:  # some were lost: ask again
        link.mav.param_request_list_send(system, COMPANION)
    elif message.get_srcComponent() == COMPANION:
        values[message.param_id], count = message.param_value, message.param_count

print(f"{len(values)} parameters")
for name in ("SLZ_SAFE_SLOPE", "SLZ_RELIEF_M", "SLZ_FOOTPRINT_M"):
    print(f"{name} = {values[name]:g}")
