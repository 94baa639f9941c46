"""Which zones would a flight have found with other limits? Its recording, run again with and without them."""

import json
import subprocess
import sys

file = sys.argv[1] if len(sys.argv) > 1 else "out/demo/flight.mcap"  # of slz demo

for limits in ([], ["safe_slope_deg=3", "relief_m=0.15"]):
    options = [word for limit in limits for word in ("--set", limit)]
    done = subprocess.run(["slz", "replay", file, "--json", *options], stdout=subprocess.PIPE, check=True)
    flight = json.loads(done.stdout)
    equal = f"{flight['identical']} of {flight['windows']} reports equal those of the flight"
    print(f"{' '.join(limits) or 'as flown'}: {equal}")  # without other limits all do, to the last bit
    for zone in flight["zones"]:
        print(f"  zone {zone['id']}: {zone['area_m2']:.0f} m2, certainty {zone['certainty']:.2f}")
