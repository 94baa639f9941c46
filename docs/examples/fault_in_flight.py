"""How does a landing end when GPS fails in the descent? `slz sim` injects it, `slz run` sums up."""

import json
import subprocess

# The vehicle takes off by itself, and GPS is lost below 8 m. It flies in real time, two minutes.
simulator = """slz sim --scene plain --point-rate 50000 --pilot takeoff --takeoff-alt 15 --fault gps_loss@8
    --mavlink tcpin:127.0.0.1:5760 --duration 120"""
companion = """slz run --mavlink tcp:127.0.0.1:5760 --lidar livox:127.0.0.1:56301 --land auto
    --set survey_s=8 --json"""

sim = subprocess.Popen(simulator.split(), stdout=subprocess.PIPE)
sim.stdout.readline()  # it is ready
run = subprocess.Popen(companion.split(), stdout=subprocess.PIPE)
sim.wait()
run.terminate()
flight = json.loads(run.communicate()[0].splitlines()[-1])  # the last line sums the flight up

# What the pilot reads meanwhile is on stderr: GPS lost, landing at once; then the autopilot's failsafe lands.
print(f"failsafes of the autopilot: {', '.join(flight['failsafes'])}")
print(f"landed by slz: {flight['landed']}, aborted landings: {flight['aborts']}")
