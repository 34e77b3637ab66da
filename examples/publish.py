"""Streams a flight table into wingwatch over Zenoh, with bare eclipse-zenoh, as an aircraft's computer would.

python examples/publish.py flight.csv uav1 aerosonde [tcp/127.0.0.1:7447] [speed]
"""

import csv
import json
import sys
import time

import zenoh

flight, vehicle, aircraft, *more = sys.argv[1:]
endpoint = more[0] if more else "tcp/127.0.0.1:7447"
speed = float(more[1]) if len(more) > 1 else 1.0

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with open(flight, encoding="utf-8") as file, zenoh.open(config) as session:
    rows = list(csv.DictReader(file))
    key = f"wingwatch/v1/default/{vehicle}"
    alive = session.liveliness().declare_token(f"wingwatch/alive/v1/default/{vehicle}")
    time.sleep(1.0)  # the service hears of this vehicle
    session.put(f"{key}/aircraft", json.dumps({"aircraft": aircraft}), encoding="application/json")
    stream, begun_s = time.time_ns(), time.monotonic()  # stream: new at each start
    for sequence, first in enumerate(range(0, len(rows), 10)):
        batch = rows[first : first + 10]
        columns = {name: [float(row[name]) if row[name] else None for row in batch] for name in rows[0]}
        message = {"sequence": sequence, "stream": stream, "columns": columns}
        late_s = (float(batch[-1]["time_s"]) - float(rows[0]["time_s"])) / speed - (
            time.monotonic() - begun_s
        )
        time.sleep(max(0.0, late_s))
        session.put(f"{key}/sensors", json.dumps(message), encoding="application/json")
    time.sleep(0.5)  # the last message leaves
