"""Makes the monitor of a vehicle from what it said it is, what its messages carry, and what is kept of it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import Envelope
from wingwatch.monitor.chain import Chain
from wingwatch.monitor.judge import JudgeConfig
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle import VehicleMonitor, surface_kinds
from wingwatch.telemetry import AircraftMessage, derivations

__all__ = ["MonitorMaker"]

_KEPT_TYPES = 64
"""Types in a configuration and loading whose stated envelopes are kept, and with certain channels whose estimators are:
invented names cannot fill the memory."""

_Type = tuple[str, str, float | None, float]
"""Name, configuration, mass and shift of the centre of gravity."""


class MonitorMaker:
    """Makes monitors; what vehicles of one type share is worked out once.

    Args:
        new_id: makes alert ids.
        judge: settings of the test.
    """

    def __init__(self, new_id: Callable[[], str], judge: JudgeConfig) -> None:
        self._new_id, self._judge = new_id, judge
        self._apriori: dict[_Type, tuple[Aircraft, Mapping[str, Envelope]]] = {}
        self._chains: dict[tuple[_Type, tuple[str, ...]], Chain] = {}

    def make(
        self,
        fleet: str,
        vehicle: str,
        aircraft: Aircraft,
        announced: AircraftMessage,
        given: Sequence[str],
        memory: VehicleMemory,
    ) -> VehicleMonitor:
        """A monitor at the start of a flight.

        Args:
            aircraft: as it is loaded (``Loading.aircraft``).
            given: channels that the vehicle's messages carry: these count, not what its first few samples happen to
                hold, for a vane may start late.
            memory: what is kept of its earlier flights.
        """
        mass_kg = aircraft.mass.mass_kg if aircraft.mass else None
        place = (aircraft.name, announced.configuration, mass_kg, aircraft.cg_shift_m)
        known_type, apriori = self._apriori.get(place, (None, {}))
        if known_type != aircraft:
            apriori = {}
        kind = (place, tuple(given))
        shared = self._chains.get(kind)
        if memory.envelopes or (shared is not None and shared.aircraft != aircraft):
            shared = None
        monitor = VehicleMonitor(
            aircraft, fleet, vehicle, [*given, *derivations(given)], surface_kinds(given),
            configuration=announced.configuration, references=memory.references,
            envelopes={**apriori, **memory.envelopes}, cells=memory.cells, chain=shared,
            new_id=self._new_id, config=self._judge,
        )  # fmt: skip
        stated = {k: v for k, v in monitor.chain.envelopes.items() if k not in memory.envelopes}
        # One type's vehicles share what its file says: linearised once, not once a vehicle.
        self._apriori[place] = aircraft, {**apriori, **stated}
        if not memory.envelopes:
            self._chains[kind] = (
                monitor.chain.of_another()
            )  # the monitor's own may take in other expectations
        _drop_oldest(self._apriori)
        _drop_oldest(self._chains)
        return monitor


def _drop_oldest(kept: dict[Any, Any]) -> None:
    while len(kept) > _KEPT_TYPES:
        kept.pop(next(iter(kept)))
