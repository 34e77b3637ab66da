"""The table of a study: one row a flight, as Parquet with the study's settings beside it."""

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from wingwatch.aircraft import Aircraft
from wingwatch.studies.grid import Grid, Kind, StudyError, checked_grid

__all__ = [
    "COLUMNS",
    "SCHEMA",
    "Study",
    "StudySettings",
    "read_settings",
    "read_study",
    "rows_table",
    "shown_aircraft",
    "write_atomically",
    "write_study",
]

SCHEMA_VERSION = 3
_KEY = b"wingwatch.study"

COLUMNS: Mapping[str, pa.DataType] = {
    "kind": pa.string(),
    "seed": pa.int64(),
    "failed": pa.string(),
    "command": pa.string(),
    "aircraft": pa.string(),
    "airspeed_true_m_s": pa.float64(),
    "altitude_m": pa.float64(),
    "route": pa.string(),
    "turbulence": pa.string(),
    "turbulence_model": pa.string(),
    "excitation": pa.string(),
    "excitation_period_s": pa.float64(),
    "noise_scale": pa.float64(),
    "sensors": pa.string(),
    "surfaces": pa.string(),
    "expectation": pa.string(),
    "expectation_error": pa.string(),
    "effect": pa.string(),
    "target": pa.string(),
    "channel": pa.string(),
    "severity": pa.float64(),
    "onset_s": pa.float64(),
    "ramp_s": pa.float64(),
    "icing_kind": pa.string(),
    "icing_factors": pa.string(),
    "flight_s": pa.float64(),
    "observed_s": pa.float64(),
    "healthy_h": pa.float64(),
    "detected": pa.bool_(),
    "detected_s": pa.float64(),
    "delay_s": pa.float64(),
    "derivatives_delay_s": pa.float64(),
    "first_kind": pa.string(),
    "first_cause": pa.string(),
    "first_channel": pa.string(),
    "first_right": pa.bool_(),
    "first_in_set": pa.bool_(),
    "said_kind": pa.string(),
    "said_cause": pa.string(),
    "said_channel": pa.string(),
    "said_level": pa.string(),
    "said_probability": pa.float64(),
    "right_delay_s": pa.float64(),
    "right_at_end": pa.bool_(),
    "other_kind_delay_s": pa.float64(),
    "size": pa.float64(),
    "size_standard_error": pa.float64(),
    "false_alerts": pa.int32(),
    "false_derivative_alerts": pa.int32(),
    "false_causes": pa.string(),
    "false_reasons": pa.string(),
    "alerts": pa.string(),
    "evidence_max": pa.float64(),
    "evidence_max_30_s": pa.float64(),
    "evidence_max_before": pa.float64(),
    "information": pa.float64(),
    "information_rate_per_s": pa.float64(),
    "block_scores": pa.string(),
    "bayes_factor_max": pa.float64(),
    "threshold": pa.float64(),
    "code_version": pa.string(),
    "settings_version": pa.string(),
    "wall_s": pa.float64(),
    "processor_s": pa.float64(),
}
"""Name and type of every column; ``docs/studies.md`` says what each holds. Two runs of one study differ in the last two
alone."""

SCHEMA = pa.schema(list(COLUMNS.items()))


@dataclass(frozen=True, slots=True)
class StudySettings:
    """What a study's rows follow from, all of it.

    Attributes:
        first_seed: of the first flight; the others follow one by one.
        flights: how many.
        aircraft: the grid's, by the name under which the grid knows them.
        code_version, settings_version: of the program, and of the monitor's settings.
    """

    kind: Kind
    grid: Grid
    first_seed: int
    flights: int
    aircraft: Mapping[str, Aircraft]
    code_version: str
    settings_version: str

    def as_json(self) -> str:
        """One line of JSON; ``from_json`` gives the same settings."""
        return json.dumps(
            {
                "schema": SCHEMA_VERSION,
                "kind": self.kind,
                "grid": self.grid.model_dump(mode="json"),
                "first_seed": self.first_seed,
                "flights": self.flights,
                "aircraft": {n: a.model_dump(mode="json") for n, a in self.aircraft.items()},
                "code_version": self.code_version,
                "settings_version": self.settings_version,
            },
            sort_keys=True,
        )

    @classmethod
    def from_json(cls, text: str | bytes, where: str) -> "StudySettings":
        """The settings that a file holds; ``where`` names it.

        Raises:
            StudyError: no settings, or those of another version.
        """
        try:
            kept: dict[str, Any] = json.loads(text)
            version = kept["schema"]
        except (ValueError, KeyError, TypeError):
            raise StudyError(f"{where} is no table of a wingwatch study; give one") from None
        if version != SCHEMA_VERSION:
            raise StudyError(
                f"{where} has version {version} of the study table, and this program reads version {SCHEMA_VERSION}; "
                "read it with the program that wrote it, or fly the study anew"
            )
        kind: Kind = kept["kind"]
        return cls(
            kind,
            checked_grid(kind, kept["grid"], where),
            kept["first_seed"],
            kept["flights"],
            {name: Aircraft.model_validate(a) for name, a in kept["aircraft"].items()},
            kept["code_version"],
            kept["settings_version"],
        )


@dataclass(frozen=True, slots=True)
class Study:
    """A finished study: its settings, and a row a flight in the order of the seeds."""

    settings: StudySettings
    table: pa.Table


def read_settings(path: Path) -> StudySettings:
    """The settings of a study's file.

    Raises:
        StudyError: no study, or one of another version.
        OSError: a file that cannot be read.
    """
    with path.open("rb") as file:
        try:
            metadata = pq.read_schema(file).metadata or {}
        except pa.ArrowInvalid:
            raise StudyError(f"{path} is no Parquet file; give the table of a study") from None
    return StudySettings.from_json(metadata.get(_KEY, b"null"), str(path))


def shown_aircraft(settings: Sequence[StudySettings]) -> dict[str, str]:
    """The name by which each of the grids' aircraft is shown: the file's own, where no other aircraft has it.

    An own aircraft is a path in the grid.
    """
    fleet = {name: craft for one in settings for name, craft in one.aircraft.items()}
    taken = [craft.name for craft in fleet.values()]
    return {name: craft.name if taken.count(craft.name) == 1 else name for name, craft in fleet.items()}


def read_study(path: Path) -> Study:
    """A study's file, whole.

    Raises:
        StudyError, OSError: as ``read_settings``, or a table with other columns.
    """
    settings = read_settings(path)
    table = pq.read_table(path)
    if table.schema.remove_metadata() != SCHEMA:
        raise StudyError(f"{path} has other columns than a study of its version; fly the study anew")
    return Study(settings, table)


def rows_table(rows: Iterable[Mapping[str, Any]]) -> pa.Table:
    """Rows as a table of the columns above."""
    return pa.Table.from_pylist([dict(row) for row in rows], schema=SCHEMA)


def write_study(path: Path, settings: StudySettings, parts: Iterable[pa.Table]) -> None:
    """Write a study's file from its parts, in their order; one part at a time is in memory."""
    schema = SCHEMA.with_metadata({_KEY: settings.as_json().encode()})

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            with pq.ParquetWriter(file, schema) as writer:
                for part in parts:
                    writer.write_table(part.replace_schema_metadata(schema.metadata))
            file.flush()
            os.fsync(file.fileno())

    write_atomically(path, write)


def write_atomically(path: Path, write: Callable[[Path], None]) -> None:
    """Have a file written beside its place and put there once it is whole.

    Raises:
        StudyError: it could not be written; what was there before is as it was.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        write(temporary)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise StudyError(
            f"{path} cannot be written ({(error.strerror or str(error)).lower()}); mend that, then go on with --resume"
        ) from None
