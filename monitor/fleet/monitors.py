"""Makes the monitor of a vehicle from what it said it is, what its messages carry, and what is kept of it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import replace
from typing import Any

from wingwatch.aircraft import DUTCH_ROLL, LATERAL, Aircraft, ModeStructure
from wingwatch.baselines import Envelope, apriori_envelope
from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.detection.redundancy import RedundancyWatch
from wingwatch.monitor.estimation.chain import STRUCTURES_WATCHED, Chain
from wingwatch.monitor.estimation.lacking_surfaces import missing_beside
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.vehicle_monitor import MonitorStart, VehicleMonitor, surface_kinds
from wingwatch.telemetry import AircraftMessage, derivations

__all__ = ["MonitorMaker"]

_KEPT_TYPES = 64
"""Types in a configuration and loading whose stated envelopes are kept, and with certain channels whose estimators are:
invented names cannot fill the memory."""

_MOST_PREPARED = 8
"""Types whose expectations are being worked out, half a second of processor time each."""

_Type = tuple[str, str, float | None, float]
"""Name, configuration, mass and shift of the centre of gravity."""

_Kind = tuple[_Type, tuple[str, ...], tuple[tuple[str, bytes], ...]]
"""Type, channels, and the digests of what is stored of its expectations (``Envelope.content``)."""


class MonitorMaker:
    """Makes monitors; what vehicles of one type share is worked out once.

    Args:
        new_id: makes alert ids.
        judge: settings of the test.
    """

    def __init__(self, new_id: Callable[[], str], judge: JudgeConfig) -> None:
        self._new_id, self._judge = new_id, judge
        self._apriori: dict[_Type, tuple[Aircraft, Mapping[str, Envelope]]] = {}
        self._shared: dict[_Kind, tuple[Chain, RedundancyWatch]] = {}
        self._executor: Executor | None = None
        self._prepared: dict[
            tuple[_Type, tuple[str, ...]], Future[tuple[Aircraft, Mapping[str, Envelope]]]
        ] = {}

    def prepare_with(self, executor: Executor) -> None:
        """What takes longer than a message may is worked out there from now on."""
        self._executor = executor

    def ready(self, aircraft: Aircraft, configuration: str, given: Sequence[str]) -> bool:
        """Whether ``make`` takes no longer than a message may; where not, what it needs is being worked out.

        To linearise an aircraft all over its envelope takes half a second, and every new loading needs that.

        Raises:
            Exception: what working it out failed on.
        """
        if self._executor is None:
            return True
        place = _type_of(aircraft, configuration)
        self._take_prepared()
        known_type, apriori = self._apriori.get(place, (None, {}))
        known = apriori if known_type == aircraft else {}
        lacking = tuple(
            s.name for s in _watched(aircraft, [*given, *derivations(given)]) if s.name not in known
        )
        if not lacking:
            return True
        if (failed := self._prepared.get((place, lacking))) is not None and failed.done():
            del self._prepared[place, lacking]
            failed.result()
        if len(self._prepared) < _MOST_PREPARED and (place, lacking) not in self._prepared:
            self._prepared[place, lacking] = self._executor.submit(_stated, aircraft, configuration, lacking)
        return False

    def _take_prepared(self) -> None:
        """Remember what has been worked out; failures stay for the vehicle that asks."""
        for kind, future in list(self._prepared.items()):
            if future.done() and (
                future.cancelled() or future.exception() is None or len(self._prepared) >= _MOST_PREPARED
            ):
                del self._prepared[kind]
                if future.cancelled() or future.exception() is not None:
                    continue
                place, (aircraft, found) = kind[0], future.result()
                known_type, apriori = self._apriori.pop(place, (None, {}))
                self._apriori[place] = aircraft, {**(apriori if known_type == aircraft else {}), **found}
        _drop_oldest(self._apriori)

    def stated(
        self, aircraft: Aircraft, configuration: str, names: Collection[str]
    ) -> Mapping[str, Envelope]:
        """Expectations that the file of an aircraft, as it is loaded, gives of structures; at once where ``ready``."""
        place = _type_of(aircraft, configuration)
        known_type, known = self._apriori.get(place, (None, {}))
        found = dict(known) if known_type == aircraft else {}
        lacking = [name for name in names if name not in found]
        if lacking:
            found |= _stated(aircraft, configuration, lacking)[1]
        return found

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
        place = _type_of(aircraft, announced.configuration)
        known_type, apriori = self._apriori.pop(place, (None, {}))  # the longest unused are forgotten first
        if known_type != aircraft:
            apriori = {}
        stored = tuple(sorted((name, envelope.content) for name, envelope in memory.envelopes.items()))
        kind = (place, tuple(given), stored)
        chain, relations = self._shared.get(kind, (None, None))
        if chain is not None and chain.aircraft != aircraft:
            chain = relations = None
        kept = replace(memory, envelopes={**apriori, **memory.envelopes})
        monitor = VehicleMonitor(
            aircraft, fleet, vehicle, [*given, *derivations(given)], surface_kinds(given), new_id=self._new_id,
            start=MonitorStart(announced.configuration, kept, chain, relations, self._judge),
        )  # fmt: skip
        stated = {k: v for k, v in monitor.chain.envelopes.items() if k not in memory.envelopes}
        # One type's vehicles share what its file says: linearised once, not once a vehicle.
        self._apriori[place] = aircraft, {**apriori, **stated}
        # the monitor's own chain may take in other expectations
        self._shared[kind] = monitor.chain.of_another(), monitor.relations
        _drop_oldest(self._apriori)
        _drop_oldest(self._shared)
        return monitor


def _type_of(aircraft: Aircraft, configuration: str) -> _Type:
    mass_kg = aircraft.mass.mass_kg if aircraft.mass else None
    return aircraft.name, configuration, mass_kg, aircraft.cg_shift_m


def _watched(aircraft: Aircraft, present: Sequence[str]) -> list[ModeStructure]:
    """Structures that a chain estimates from these channels, where the aircraft's file gives an expectation."""
    found = [s for s in STRUCTURES_WATCHED if not missing_beside(aircraft, s, present)]
    return [s for s in found if s is not DUTCH_ROLL or LATERAL not in found]


def _stated(
    aircraft: Aircraft, configuration: str, names: Sequence[str]
) -> tuple[Aircraft, Mapping[str, Envelope]]:
    """Expectations that the aircraft's file gives."""
    structures = [s for s in STRUCTURES_WATCHED if s.name in names]
    return aircraft, {s.name: apriori_envelope(aircraft, s, configuration) for s in structures}


def _drop_oldest(kept: dict[Any, Any]) -> None:
    while len(kept) > _KEPT_TYPES:
        kept.pop(next(iter(kept)))
