"""A flight file against the simulation of its aircraft: files in, a diagnosis out."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from wingwatch import diagnosis
from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis import Diagnosis
from wingwatch.operations.faults import CommandError
from wingwatch.operations.plausible import checked
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.telemetry import Cleaner, FlightTable, SampleBlock, load_flight
from wingwatch.telemetry.plausibility import Finding, Verdict

__all__ = ["diagnose_file"]


def diagnose_file(
    flight: Path,
    aircraft: Aircraft,
    channel_map: Path | None = None,
    validate: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
    source: str = "",
    validate_map: Path | None = None,
    accepted: bool | None = None,
) -> tuple[Diagnosis, tuple[Finding, ...]]:
    """Read, check, clean and diagnose; what the channels of the flight say of one another comes with the answer.

    Args:
        flight: CSV, Parquet or MATLAB file, or an autopilot's log.
        channel_map: of the flight, and of the other where ``validate_map`` is not given.
        validate: another flight, on which the gain is judged; parts of the first without.
        progress: called with what is being done and the fraction done.
        source: what the flight is called; its path if empty.
        validate_map: of the other flight.
        accepted: whether flights whose channels contradict each other are diagnosed; None where that cannot be asked.

    Raises:
        CommandError: a flight of which no sample is accepted, or whose channels contradict each other.
        DiagnosisError: the flight cannot be diagnosed.
        TableError, LogError, MapError, FlightError: a file that cannot be read.
    """
    if progress is not None:
        progress("reading the flight", 0.0)
    table = load_flight(flight, channel_map, surface_travel(aircraft))
    other = None
    if validate is not None:
        other = load_flight(validate, validate_map or channel_map, surface_travel(aircraft))
    findings = checked(table, aircraft, accepted)
    beside = () if other is None else checked(other, aircraft, accepted)
    doubts = [
        f"{name}: {finding.sentence}"
        for name, part in ((source or str(flight), findings), (str(validate), beside))
        for finding in part
        if finding.standing is not Verdict.RIGHT
    ]
    found = diagnosis.diagnose(
        _cleaned(table),
        aircraft,
        kinds=table.kinds,
        validate=None if other is None else _cleaned(other),
        validate_kinds=None if other is None else other.kinds,
        source=source or str(flight),
        progress=progress,
    )
    return (replace(found, notes=(*found.notes, *doubts)) if doubts else found), findings


def _cleaned(table: FlightTable) -> SampleBlock:
    cleaner = Cleaner()
    block = cleaner.clean(table.block).block
    if not len(block):
        raise CommandError(f"{table.source}: the cleaner accepted no sample ({cleaner.report.text})")
    return block
