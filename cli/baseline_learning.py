"""What healthy flights teach, offline: each through the very code that watches live, then every block of it counts.

Live, a block joins what a vehicle taught when it is three minutes old and nothing speaks against it. Here somebody
declares the flights healthy, so the last minutes count as well.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES, Affine, Aircraft, FlightCondition, ModeStructure, Provenance
from wingwatch.baselines import (
    Cell,
    CellMemory,
    Expectation,
    ExpectationRecord,
    Reference,
    aged,
    cell_of,
)
from wingwatch.cli.flight_watch import watch
from wingwatch.cli.unusable import refuse_unusable
from wingwatch.monitor import CellPlace, MonitorStart, Report, VehicleMemory, VehicleMonitor
from wingwatch.monitor.detection.blocks import FOURIER, BlockView
from wingwatch.monitor.detection.comparison import natural_size, without_bias
from wingwatch.operations.baseline_comparison import affine_at
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import Progress
from wingwatch.telemetry import FlightTable

__all__ = ["LEARNED", "FlownCell", "Lesson", "Student", "digest_of", "identified_entries"]

Array = NDArray[np.float64]

LEARNED = "learned by the Fourier estimator from"
"""How the source of what was learned begins."""

_DIGEST = 12


def digest_of(path: Path) -> str:
    """The first digits of a file's SHA-256: by it a flight is recognised, whatever it is called."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGEST]


@dataclass(slots=True)
class FlownCell:
    """What one structure's blocks in one cell of the envelope say, and where they were flown.

    Attributes:
        evidence: sum of the blocks in calm air, what gusts may have biased taken as one more error.
        natural: natural size of each derivative, (k,).
        conditions: airspeed, altitude, density and angle of attack of each block.
    """

    evidence: Reference
    natural: Array
    conditions: list[tuple[float, float, float, float]] = field(default_factory=list)

    def condition(self, configuration: str) -> FlightCondition:
        """The mean of its blocks'."""
        airspeed, altitude, density, alpha = (float(x) for x in np.mean(self.conditions, axis=0))
        return FlightCondition(airspeed, altitude, density, configuration, alpha)


@dataclass(frozen=True, slots=True)
class Lesson:
    """What one flight taught.

    Attributes:
        blocks: with evidence, of the structure that had most; seconds: they rest on.
        alerts: the sentence of each alert that the monitor raised.
    """

    name: str
    digest: str
    blocks: int
    seconds: float
    alerts: tuple[str, ...]


class Student:
    """Learns from flights, one after another: what earlier ones taught is what the next one begins with.

    Args:
        aircraft: as its file has it.
        start: configuration, and what is kept of the vehicle.

    Attributes:
        learned: what the flights taught, by structure; what was kept before is not in it.
        cells: of the envelope as the flights left them.
        flown: the same evidence by structure and cell, for expectations of the type.
    """

    def __init__(self, aircraft: Aircraft, start: MonitorStart, fleet: str, vehicle: str) -> None:
        self._aircraft, self._start = aircraft, start
        self._fleet, self._vehicle = fleet, vehicle
        self._before = dict(start.memory.references)
        self.learned: dict[str, Reference] = {}
        self.cells: dict[CellPlace, Reference] = {}
        self.flown: dict[CellPlace, FlownCell] = {}
        self._present: dict[str, Cell] = {}
        self._latest: BlockView | None = None

    def learn(self, path: Path, flight: FlightTable, progress: Progress, anyway: bool) -> Lesson:
        """Take in a flight.

        Raises:
            CommandError: the flight cannot be judged, or an alert is raised in it and that is not accepted.
        """
        before = {name: (one.blocks, one.seconds) for name, one in self.learned.items()}
        kept = {place: CellMemory(reference, 0.0) for place, reference in self.cells.items()}
        memory = self._start.memory
        start = replace(
            self._start,
            memory=VehicleMemory(self._references, memory.envelopes, {**memory.cells, **kept}),
        )
        self._present, self._latest = {}, None
        watched = watch(
            flight, self._aircraft, progress, fleet=self._fleet, vehicle=self._vehicle, start=start,
            listener=self._listen,
        )  # fmt: skip
        refuse_unusable(watched)
        alerts = tuple(f"{a.level} alert at {a.raised_s:.1f} s: {a.text}" for a in watched.alerts)
        if alerts and not anyway:
            raise CommandError(
                f"{path}: the monitor raises a {alerts[0].rstrip('.')}; a flight that teaches must be healthy: leave "
                "it out, or add --anyway where you know better"
            )
        self.cells |= watched.monitor.cells.take_changed()
        blocks, seconds = self._gained(before)
        return Lesson(path.name, digest_of(path), blocks, seconds, alerts)

    @property
    def configuration(self) -> str:
        """Of the aircraft."""
        return self._start.configuration

    @property
    def _references(self) -> Mapping[str, Reference]:
        """What was kept before, and what the flights so far have taught."""
        total = dict(self._before)
        for name, learned in self.learned.items():
            total[name] = total[name].plus(learned) if name in total else learned
        return total

    def _gained(self, before: Mapping[str, tuple[int, float]]) -> tuple[int, float]:
        now = {name: (one.blocks, one.seconds) for name, one in self.learned.items()}
        gains = [
            (blocks - before.get(name, (0, 0.0))[0], seconds - before.get(name, (0, 0.0))[1])
            for name, (blocks, seconds) in now.items()
        ]
        return max(gains, default=(0, 0.0))

    def _listen(self, monitor: VehicleMonitor, report: Report) -> None:
        """Each block once, when it has been compared."""
        block = monitor.last_block
        if block is None or block is self._latest:
            return
        self._latest = block
        block_s = monitor.judge.config.block_s
        for name, mode in block.modes.items():
            information, vector = mode.evidence.information[FOURIER], mode.evidence.vector[FOURIER]
            if np.trace(information) <= 0.0:
                continue
            known = self.learned.get(name) or Reference.empty(vector.size)
            self.learned[name] = known.add(information, vector, block_s)
            if not mode.rough:
                natural = natural_size(mode.expected, mode.expected_covariance)
                calm = without_bias(information, vector, mode.evidence.bias[FOURIER])
                self._fly(name, block.condition, calm, natural, block_s)

    def _fly(
        self,
        name: str,
        at: FlightCondition,
        evidence: tuple[Array, Array],
        natural: Array,
        seconds: float,
    ) -> None:
        """One more block in its cell of the envelope."""
        cell = cell_of(at.airspeed_true_m_s, at.altitude_m, self._present.get(name))
        self._present[name] = cell
        flown = self.flown.setdefault((name, cell), FlownCell(Reference.empty(natural.size), natural))
        information, vector = evidence
        flown.evidence = flown.evidence.add(0.5 * (information + information.T), vector, seconds)
        flown.natural = natural
        flown.conditions.append(
            (at.airspeed_true_m_s, at.altitude_m, at.air_density_kg_m3, at.angle_of_attack_rad)
        )


def identified_entries(
    student: Student, aircraft: Aircraft, current: Sequence[ExpectationRecord], source: str, at_s: float
) -> tuple[list[tuple[ExpectationRecord, tuple[int, ...]]], dict[str, str]]:
    """Expectations of the type at the conditions that were flown.

    An entry rests on flights alone. What was learned in its cell before is joined and superseded. An entry claims no
    more than 3 % of a derivative's natural size, as what a cell remembers does (decision 0016).

    Args:
        current: entries that count, of the aircraft and configuration.

    Returns:
        entries, each with the ids of those whose place it takes; and why there is none, by structure.
    """
    entries: list[tuple[ExpectationRecord, tuple[int, ...]]] = []
    lacking: dict[str, str] = {}
    for (name, cell), flown in sorted(student.flown.items()):
        structure = STRUCTURES[name]
        condition = flown.condition(student.configuration)
        conversion = _at(structure, aircraft, condition)
        evidence, earlier = flown.evidence, _learned_before(current, name, cell)
        for one in earlier:
            known = one.expectation
            at = _at(structure, aircraft, known.condition)
            value, covariance = at.from_concise(known.value, known.covariance)
            information = np.linalg.inv(covariance)
            information = 0.5 * (information + information.T)
            evidence = evidence.plus(Reference(information, information @ value))
        found = aged(CellMemory(evidence, 0.0), flown.natural).estimate()
        if found is None:
            lacking[name] = _why_lacking(structure, evidence, cell)
            continue
        value, covariance = conversion.to_concise(*found)
        said = "; with what was ".join([source, *(one.source for one in earlier)])
        expectation = Expectation(structure, value, covariance, Provenance.IDENTIFIED, condition, said)
        record = ExpectationRecord.of(aircraft.name, expectation, at_s)
        entries.append((record, tuple(one.id for one in earlier if one.id is not None)))
    return entries, lacking


def _at(structure: ModeStructure, aircraft: Aircraft, condition: FlightCondition) -> Affine:
    each = affine_at(structure, aircraft, [condition])
    return Affine(each.scale[0], each.offset[0])


def _learned_before(current: Sequence[ExpectationRecord], name: str, cell: Cell) -> list[ExpectationRecord]:
    """Entries of the structure that were learned in this cell."""
    return [
        one
        for one in current
        if one.structure == name
        and one.source.startswith(LEARNED)
        and cell_of(one.airspeed_true_m_s, one.altitude_m) == cell
    ]


def _why_lacking(structure: ModeStructure, evidence: Reference, cell: Cell) -> str:
    diagonal = np.diagonal(evidence.information)
    unknown = [s for s, d in zip(structure.derivatives, diagonal, strict=True) if d <= 0.0]
    what = f"of {', '.join(unknown)} they say nothing" if unknown else "some derivatives moved together"
    return (
        f"the flights at {cell.text} do not determine all derivatives ({what}); fly inputs of every surface"
    )
