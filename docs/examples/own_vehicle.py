"""How do I describe my own vehicle? By a profile: the differences from one of ours, in a TOML file."""

from pathlib import Path

import params

Path("mine.toml").write_text("""
profile = "quadcopter"       # what the file does not name is as there
footprint_m = 1.8            # across what must be safe, and more than the gear
gear = "skids"
gear_length_m = 0.9          # along a skid
gear_width_m = 0.7           # from skid to skid
clearance_m = 0.25           # of the belly over the skids
rotor_diameter_m = 1.4       # of the circle around all propellers
rotor_height_m = 0.6         # of the propellers over the skids
safe_slope_deg = 8.0         # steeper ground is not safe
min_square_m = 4.0           # a zone holds a square of this side
max_wind_ms = 9.0
lidar_pitch_deg = 90.0       # the LiDAR looks straight down
""")

parameters = params.load("mine.toml")  # the same file: slz run --profile mine.toml ...
usual = params.load("quadcopter")
for row in params.rows():  # name, unit, range, default, MAVLink name and one sentence of each
    value, before = getattr(parameters, row.name), getattr(usual, row.name)
    if value != before:
        print(f"{row.name} = {value}, not {before}; by MAVLink {row.mavlink}")

try:
    params.load("mine.toml", ["min_square_m=-1"])
except params.ParameterError as error:
    print(f"refused: {error}")
