"""Does slz land in the simulator, and where? `slz demo` flies, and says it as one JSON object."""

import json
import subprocess

# A meadow with objects; fewer points than a Mid-360 has, for small computers. --seed changes scene and wind.
command = ["slz", "demo", "--scene", "plain", "--seed", "3", "--point-rate", "50000", "--headless", "--json"]
done = subprocess.run(command, stdout=subprocess.PIPE, check=False)  # exit code 0: landed on safe ground
flight = json.loads(done.stdout)

print(f"landed: {flight['landed']}, on truly safe ground: {flight['touchdown_safe']}")
print(f"{flight['touchdown_error_m']:.2f} m from the chosen point, after {flight['aborts']} aborted landings")
print(f"ground called safe that is not: {100 * flight['unsafe_as_safe']:.3f} % of the cells seen")
print(f"a return is in the report after {flight['latency_ms']['p50']:.0f} ms (median)")
print(f"pictures and maps: {', '.join(flight['files'].values())}")
