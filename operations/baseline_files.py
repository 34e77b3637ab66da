"""Files that carry a baseline from one database to another, to the bit.

JSON, one record a line: entries, versions of references and cells, with the units and the order of their derivatives.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wingwatch.aircraft import DERIVATIVES, STRUCTURES, FlightCondition, Provenance
from wingwatch.baselines import (
    BaselineContent,
    Cell,
    CellRecord,
    ExpectationRecord,
    Reference,
    ReferenceKey,
    ReferenceRecord,
)
from wingwatch.operations.faults import CommandError
from wingwatch.telemetry import check_name

__all__ = ["FORMAT", "VERSION", "content_of", "read_content", "write_content"]

FORMAT = "wingwatch baseline"
VERSION = 1

_Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
_Row = list[_Finite]
_Text = Annotated[str, Field(max_length=100_000)]
_Name = Annotated[str, Field(min_length=1, max_length=100)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    aircraft: Annotated[str, Field(min_length=1, max_length=200)]
    configuration: _Name
    structure: str
    derivatives: list[str]


class _Entry(_Record):
    airspeed_true_m_s: _Finite
    altitude_m: _Finite
    air_density_kg_m3: _Finite
    angle_of_attack_rad: _Finite
    value: _Row
    covariance: list[_Row]
    provenance: Provenance
    source: _Text
    created_at_s: _Finite


class _Taught(_Record):
    fleet: str
    vehicle: str
    information: list[_Row]
    vector: _Row
    blocks: Annotated[int, Field(ge=0, le=2**31 - 1, strict=True)]
    seconds: _Finite
    updated_at_s: _Finite


class _Version(_Taught):
    source: _Text


class _Cell(_Taught):
    cell: tuple[int, int]


class _File(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["wingwatch baseline"]
    version: int
    units: dict[str, str]
    entries: list[_Entry]
    references: list[_Version]
    cells: list[_Cell]


def write_content(content: BaselineContent, out: Path) -> None:
    """Write the file: whole, or not at all.

    Raises:
        OSError: it cannot be written.
    """
    part = out.with_name(f".{out.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.writelines(_lines(content))
            file.flush()
            os.fsync(file.fileno())
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)


def _lines(content: BaselineContent) -> Iterator[str]:
    records: dict[str, list[dict[str, Any]]] = {
        "entries": [_of_entry(one) for one in content.entries],
        "references": [_of_version(one) for one in content.references],
        "cells": [_of_cell(one) for one in content.cells],
    }
    symbols = dict.fromkeys(s for kind in records.values() for one in kind for s in one["derivatives"])
    units = {symbol: DERIVATIVES[symbol].unit for symbol in symbols}
    yield f'{{"format": {_json(FORMAT)}, "version": {VERSION},\n "units": {_json(units)}'
    for name, kind in records.items():
        yield f",\n {_json(name)}: ["
        yield ",".join(f"\n  {_json(one)}" for one in kind)
        yield "]"
    yield "}\n"


def _json(value: Any) -> str:
    """Floats with as many digits as read back to the same bits."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _of_entry(one: ExpectationRecord) -> dict[str, Any]:
    left_out = ("id", "superseded_by", "change_id")
    values = {key: value for key, value in asdict(one).items() if key not in left_out}
    return {**values, "derivatives": list(STRUCTURES[one.structure].derivatives)}


def _of_taught(one: ReferenceRecord | CellRecord) -> dict[str, Any]:
    derivatives = list(STRUCTURES[one.key.structure].derivatives)
    return {
        **asdict(one.key), "derivatives": derivatives, **one.reference.to_dict(), "updated_at_s": one.updated_at_s,
    }  # fmt: skip


def _of_version(one: ReferenceRecord) -> dict[str, Any]:
    return {**_of_taught(one), "source": one.source}


def _of_cell(one: CellRecord) -> dict[str, Any]:
    return {**_of_taught(one), "cell": [one.cell.airspeed, one.cell.altitude]}


def read_content(path: Path, aircraft: str | None) -> BaselineContent:
    """What a file holds.

    Args:
        aircraft: whose it must be; anybody's where None.

    Raises:
        CommandError: no such file, one that is half written or of another version, units, derivatives or aircraft that
            are not ours; one sentence.
    """
    if path.suffix.lower() == ".toml":
        raise CommandError(
            f"--file {path}: aircraft files are given with --aircraft; --file takes what export wrote"
        )
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise CommandError(
            f"{path}: it is no whole file of `wingwatch baseline export` ({error}); export it again"
        ) from None
    return content_of(document, str(path), aircraft)


def content_of(document: object, where: str, aircraft: str | None) -> BaselineContent:
    """What the JSON value of such a file holds.

    Args:
        where: what errors call it.
        aircraft: whose it must be; anybody's where None.

    Raises:
        CommandError: as ``read_content``.
    """
    found = _validated(document, where)
    for symbol, unit in found.units.items():
        if symbol not in DERIVATIVES or DERIVATIVES[symbol].unit != unit:
            ours = (
                f"here it is {DERIVATIVES[symbol].unit}" if symbol in DERIVATIVES else "it is not known here"
            )
            raise CommandError(f"{where}: {symbol} is in {unit}, and {ours}; convert the file")
    for number, one in enumerate((*found.entries, *found.references, *found.cells), 1):
        _check_record(where, number, one, found.units, aircraft)
    try:
        return BaselineContent(
            tuple(map(_entry, found.entries)),
            tuple(
                ReferenceRecord(_key(one), _reference(one), one.updated_at_s, one.source)
                for one in found.references
            ),
            tuple(
                CellRecord(_key(one), Cell(*one.cell), _reference(one), one.updated_at_s)
                for one in found.cells
            ),
        )
    except ValueError as error:
        raise CommandError(f"{where}: {error}; export it again") from None


def _validated(document: object, where: str) -> _File:
    if not isinstance(document, Mapping) or document.get("format") != FORMAT:
        raise CommandError(
            f"{where}: it was not written by `wingwatch baseline export`; give a file that was"
        )
    if document.get("version") != VERSION:
        raise CommandError(
            f"{where}: it has version {document.get('version')!r:.40} of the format, and this program reads version "
            f"{VERSION}; export it again with this version of wingwatch, or use the one that wrote it"
        )
    try:
        return _File.model_validate(document)
    except ValidationError as error:
        fault = error.errors()[0]
        place = ".".join(str(part) for part in fault["loc"])
        raise CommandError(f"{where}: {place}: {fault['msg'].lower()}; export it again") from None


def _check_record(
    where: str, number: int, one: _Record, units: Mapping[str, str], aircraft: str | None
) -> None:
    """Whose it is, and whether its derivatives are ours."""
    if aircraft is not None and one.aircraft != aircraft:
        raise CommandError(
            f"{where}: record {number} is of aircraft {one.aircraft}, not of {aircraft}; leave out --aircraft"
        )
    structure = STRUCTURES.get(one.structure)
    if structure is None:
        raise CommandError(
            f"{where}: record {number} is of structure {one.structure!r:.60}; known are {', '.join(STRUCTURES)}"
        )
    if tuple(one.derivatives) != structure.derivatives or not set(one.derivatives) <= set(units):
        raise CommandError(
            f"{where}: record {number} has derivatives {', '.join(one.derivatives)!s:.200}, and {one.structure} has "
            f"{', '.join(structure.derivatives)} here, each with its unit; export it again"
        )


def _entry(one: _Entry) -> ExpectationRecord:
    FlightCondition(
        one.airspeed_true_m_s,
        one.altitude_m,
        one.air_density_kg_m3,
        one.configuration,
        one.angle_of_attack_rad,
    )
    # A covariance has what an information matrix must have: it is finite, symmetric and positive semidefinite.
    Reference(np.array(one.covariance, ndmin=2), np.array(one.value))
    values = {key: getattr(one, key) for key in _Entry.model_fields if key != "derivatives"}
    return ExpectationRecord(
        **{
            **values,
            "value": tuple(one.value),
            "covariance": _rows(one.covariance),
            "provenance": str(one.provenance),
        }
    )


def _rows(matrix: Sequence[Iterable[float]]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix)


def _key(one: _Taught) -> ReferenceKey:
    return ReferenceKey(
        check_name("fleet", one.fleet), check_name("vehicle", one.vehicle), one.aircraft, one.configuration,
        one.structure,
    )  # fmt: skip


def _reference(one: _Taught) -> Reference:
    return Reference(np.array(one.information, ndmin=2), np.array(one.vector), one.blocks, one.seconds)
