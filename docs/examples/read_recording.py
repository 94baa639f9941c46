"""What is in the recording of a flight? By default that of `slz demo`; `slz run --record` makes others."""

import json
import sys

import matplotlib.pyplot as plt
from mcap.reader import make_reader

file = sys.argv[1] if len(sys.argv) > 1 else "out/demo/flight.mcap"
seconds, areas, certainties = [], [], []
with open(file, "rb") as stream:
    reader = make_reader(stream)
    counts = reader.get_summary().statistics.channel_message_counts
    for number, channel in reader.get_summary().channels.items():
        print(f"{channel.topic}: {counts.get(number, 0)} messages")

    # Raw topics hold all that came, and of each window the report with its zones, the best first.
    for _, _, message in reader.iter_messages(topics=["/raw/report"]):
        report = json.loads(message.data)
        seconds.append(message.log_time / 1e9)
        areas.append(sum(zone["area_m2"] for zone in report["near"]))
        certainties.append(report["near"][0]["certainty"] if report["near"] else 0.0)

print(f"{len(seconds)} windows; in the last, zones of {areas[-1]:.0f} m2, certainty {certainties[-1]:.2f}")
since_start = [second - seconds[0] for second in seconds]
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6, 3.5), layout="constrained")
above.plot(since_start, areas)
above.set_ylabel("zones, m2")
below.plot(since_start, certainties)
below.set(ylabel="certainty", xlabel="seconds since the first window")
figure.savefig("read_recording.png", dpi=72)
