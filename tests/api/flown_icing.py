"""A simulated flight into ice through the monitor, its database and the door, for tests of pictures over time."""

import contextlib
import time
from collections.abc import Generator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from wingwatch.aircraft import load_aircraft
from wingwatch.api import AppSettings, HttpServer, create_app, listen
from wingwatch.baselines import open_database
from wingwatch.monitor import FleetMonitor, FleetPorts
from wingwatch.service.patient import PatientHistory
from wingwatch.service.patient_baselines import PatientBaselines
from wingwatch.service.store import DatabaseStore
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import PROTOBUF, AircraftMessage, SampleBlock, encode_aircraft, encode_sensors

__all__ = ["ICE_FROM_S", "FlownIcing", "flown_icing"]

ICE_FROM_S, ALERT_BY_S, SECONDS = 60, 104, 125
RATE_HZ = 50
WALL_AT_S = 1.8e9
_PATIENCE_S = 20.0


@dataclass
class FlownIcing:
    """The service, and its one vehicle, which flies on by command.

    Attributes:
        url: of the service.
        now_s: how far it has flown; landed_s: time of the flights before.
    """

    fleet: FleetMonitor
    store: DatabaseStore
    samples: SampleBlock
    url: str = ""
    now_s: int = 0
    landed_s: int = 0
    _numbers: "count[int]" = field(default_factory=count)

    def clock(self) -> float:
        return 1000.0 + self.landed_s + self.now_s

    def fly_anew(self, to_s: int) -> None:
        """The same flight from its beginning: a new one by the vehicle's clock."""
        self.landed_s += self.now_s
        self.now_s = 0
        self.fly(to_s)

    def fly(self, to_s: int) -> None:
        """A message a second, and all that comes of it is in the database."""
        while self.now_s < to_s:
            some = SampleBlock(self.samples.values[self.now_s * RATE_HZ : (self.now_s + 1) * RATE_HZ])
            self.now_s += 1
            payload = encode_sensors(next(self._numbers), some, PROTOBUF)
            self.fleet.receive("default", "icing", "sensors", payload, PROTOBUF)
            self.fleet.tick()
        until_s = time.monotonic() + _PATIENCE_S
        while any(self.store.waiting.values()):
            if time.monotonic() > until_s:
                raise AssertionError(f"the store still has {self.store.waiting}")
            time.sleep(0.01)


@contextlib.contextmanager
def flown_icing(folder: Path) -> Generator[FlownIcing]:
    """The demonstration's flight into ice, flown until its alert stands."""
    scenario = next(one for one in demo_fleet() if one.name == "icing")
    ids = count(1)
    aircraft = load_aircraft("aerosonde")
    with open_database(folder / "wingwatch.db") as database, contextlib.ExitStack() as stack:
        flown: list[FlownIcing] = []
        wall = lambda: WALL_AT_S + (flown[0].clock() if flown else 0.0)  # noqa: E731
        store = stack.enter_context(DatabaseStore(database, wall))
        fleet = FleetMonitor(
            lambda _: aircraft,
            lambda: flown[0].clock() if flown else 1000.0,
            lambda: f"a{next(ids)}",
            FleetPorts(store),
            wall_clock=wall,
        )
        flown.append(FlownIcing(fleet, store, simulate(scenario, float(SECONDS))))
        message = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
        fleet.receive("default", "icing", "aircraft", message, PROTOBUF)
        flown[0].fly(ALERT_BY_S)
        settings = AppSettings(baselines=PatientBaselines(database, wall))
        app = create_app(fleet, lambda: {"database": None}, PatientHistory(database), "9.8.7", settings)
        with HttpServer(app, listen("127.0.0.1", 0)) as server:
            flown[0].url = server.url
            yield flown[0]
