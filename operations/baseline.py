"""What the baseline database holds for one aircraft and one vehicle, in the form the monitor takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from wingwatch.aircraft import STRUCTURES, Aircraft, Provenance
from wingwatch.baselines import (
    DECLARED,
    MEASURED,
    Cell,
    CellMemory,
    Database,
    Envelope,
    Reference,
    ReferenceKey,
    open_database,
)
from wingwatch.operations.faults import CommandError

__all__ = [
    "Baseline",
    "check_exists",
    "read_baseline",
    "stored_cells",
    "stored_envelopes",
    "stored_references",
]


@dataclass(frozen=True, slots=True)
class Baseline:
    """Expectations and learned references by structure; empty where there are none."""

    envelopes: Mapping[str, Envelope] = field(default_factory=dict)
    references: Mapping[str, Reference] = field(default_factory=dict)


def check_exists(option: str, where: str) -> None:
    """Refuse a database file that does not exist: reading makes none.

    Raises:
        CommandError: there is no such file.
    """
    if "://" not in where and not Path(where).is_file():
        raise CommandError(f"{option} {where}: there is no such file; give the database of a service")


def read_baseline(
    where: str, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str = "clean"
) -> Baseline:
    """What a database, path or URL, says of a vehicle.

    Raises:
        CommandError: the file does not exist (it is not made here).
        DatabaseError: the database cannot be read.
    """
    check_exists("--baseline", where)
    with open_database(where) as database:
        return Baseline(
            stored_envelopes(database, aircraft, configuration),
            stored_references(database, fleet, vehicle, aircraft.name, configuration),
        )


def stored_envelopes(database: Database, aircraft: Aircraft, configuration: str) -> dict[str, Envelope]:
    """An envelope for each structure that the database has entries of; these go before the aircraft file's.

    A-priori entries span an envelope that somebody declared, so nothing beyond them is answered; around
    entries of flights there is the usual neighbourhood.
    """
    envelopes: dict[str, Envelope] = {}
    for name, structure in STRUCTURES.items():
        points = [e.expectation for e in database.expectations(aircraft.name, configuration, name)]
        if points:
            declared = all(p.provenance is Provenance.A_PRIORI for p in points)
            envelopes[name] = Envelope(
                aircraft,
                structure,
                points,
                configuration=configuration,
                neighbourhood=DECLARED if declared else MEASURED,
            )
    return envelopes


def stored_references(
    database: Database, fleet: str, vehicle: str, aircraft: str, configuration: str
) -> dict[str, Reference]:
    """What a vehicle's earlier flights taught, by structure."""
    keys = {name: ReferenceKey(fleet, vehicle, aircraft, configuration, name) for name in STRUCTURES}
    found = {name: database.load_reference(key) for name, key in keys.items()}
    return {name: reference for name, reference in found.items() if reference is not None}


def stored_cells(
    database: Database, fleet: str, vehicle: str, aircraft: str, configuration: str, now_at_s: float
) -> dict[tuple[str, Cell], CellMemory]:
    """What a vehicle's earlier flights remember of cells of the envelope, by structure and cell."""
    found: dict[tuple[str, Cell], CellMemory] = {}
    for name in STRUCTURES:
        key = ReferenceKey(fleet, vehicle, aircraft, configuration, name)
        found.update(((name, cell), m) for cell, m in database.load_cells(key, now_at_s).items())
    return found
