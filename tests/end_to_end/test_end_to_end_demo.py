"""The demonstration's fleet, flown faster than life through a real session: the right alerts, in time, and no other."""

import math
from pathlib import Path

import numpy as np
from live import get, service_in, until

from wingwatch.cli.simulated_fleet import SimulatedFleet
from wingwatch.simulation import demo_fleet

SPEED = 10.0
PATIENCE_S = 240.0
"""The fleet waits for a machine that cannot keep up, and only what is flown counts."""
ONSETS_S = {"icing": 60.0, "elevator": 90.0}
ALERT_WITHIN_S = 60.0
EXPECTED = {"icing": ("icing", "icing"), "elevator": ("damage", "elevator_effectiveness")}


def test_the_demonstration_shows_what_it_promises(tmp_path: Path) -> None:
    end_s = max(ONSETS_S.values()) + ALERT_WITHIN_S
    with (
        service_in(tmp_path) as (service, endpoint),
        SimulatedFleet(demo_fleet(), endpoint, speed=SPEED) as fleet,
    ):

        def flown_s() -> float:
            assert fleet.problem is None
            assert service.ingest.faults == 0
            items = get(service, "/v1/vehicles")["items"]
            return (
                min([v["last_sample_time_s"] or 0.0 for v in items], default=0.0) if len(items) == 3 else 0.0
            )

        until(lambda: flown_s() >= end_s, PATIENCE_S)
        alerts = {alert["vehicle"]: alert for alert in get(service, "/v1/alerts")["items"]}
        rows = {v["vehicle"]: v for v in get(service, "/v1/fleet")["vehicles"]}
        vehicles = {v["vehicle"]: v for v in get(service, "/v1/vehicles")["items"]}
    assert set(alerts) == set(EXPECTED)
    for name, alert in alerts.items():
        assert (alert["kind"], alert["cause"]) == EXPECTED[name]
        assert ONSETS_S[name] < alert["raised_s"] <= ONSETS_S[name] + ALERT_WITHIN_S
        assert alert["size"]["standard_error"] > 0.0
        assert alert["evidence"]
    east_m = [111_195.0 * math.cos(math.radians(50.0)) * rows[name]["longitude_deg"]
              for name in ("healthy", "icing", "elevator")]  # fmt: skip
    assert min(np.diff(east_m)) > 200.0, "the plan of the page shows them apart"
    assert vehicles["healthy"]["active_alerts"] == []
    assert "messages_lost" not in vehicles["healthy"]["counts"]
