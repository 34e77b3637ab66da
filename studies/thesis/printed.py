"""What the thesis prints: result tables of chapters 7 to 9 and the plants that they are about."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import MODEL_STRUCTURES, FlightCondition, ModeStructure

__all__ = [
    "TABLES_IN_CHAPTERS",
    "Plant",
    "PrintedCase",
    "PrintedTable",
    "Pulses",
    "plants",
    "printed_pulses",
    "printed_tables",
]

Array = NDArray[np.float64]
Kind = Literal["derivatives", "fit", "frequency"]

TABLES_IN_CHAPTERS = 44
"""Numbered tables of chapters 7 to 9: 20, 16 and 8. Two hold no result: 7.1 (widths of pulses), 7.12 (sensors)."""


@dataclass(frozen=True, slots=True)
class Plant:
    """A plant of two states whose derivatives the thesis prints.

    Attributes:
        name: key of the data file.
        structure: short period or Dutch roll.
        derivatives: concise, in the order of the structure.
        condition: airspeed and altitude.
        frequency: natural and damped frequency, rad/s, and damping ratio, as printed.
        derivatives_from, frequency_from: tables that print them.
        is_the: what these derivatives are in the thesis.
    """

    name: str
    structure: ModeStructure
    derivatives: tuple[float, ...]
    condition: FlightCondition
    frequency: tuple[float, float, float]
    derivatives_from: str
    frequency_from: str
    is_the: str

    @property
    def title(self) -> str:
        """In words."""
        return self.name.replace("_", " ").capitalize()

    @property
    def by_symbol(self) -> dict[str, float]:
        """Derivatives by symbol."""
        return dict(zip(self.structure.derivatives, self.derivatives, strict=True))

    @property
    def turn(self) -> float:
        """Kinematic part of the rate's derivative in the force equation, m/s: +U in z_q, -U in y_r."""
        forward = self.condition.forward_velocity_m_s
        return forward if self.structure.states[1] == "q" else -forward

    @property
    def flown(self) -> bool:
        """Whether the thesis's own records are of an aircraft in flight, which are not public."""
        return self.name.startswith("jetstream")


@dataclass(frozen=True, slots=True)
class PrintedCase:
    """One column or row of a table.

    Attributes:
        name: of the case, as ``cases.case_of`` reads it.
        values: six derivatives; R2 in percent, Theil's coefficient and three shares; or two frequencies and a ratio.
        errors: standard errors of derivatives, else None.
    """

    name: str
    values: Array
    errors: Array | None


@dataclass(frozen=True, slots=True)
class PrintedTable:
    """One table.

    Attributes:
        number, section: in the thesis.
        plant: what it is about.
        kind: what its cases hold.
        about: in a clause.
        state: of a fit, which of the two states.
        cases: in the order of the thesis.
    """

    number: str
    section: str
    plant: Plant
    kind: Kind
    about: str
    state: int
    cases: tuple[PrintedCase, ...]


@dataclass(frozen=True, slots=True)
class Pulses:
    """Table 7.1: natural frequency in rad/s and width of a doublet's pulse in s, by plant."""

    number: str
    section: str
    by_plant: dict[str, tuple[float, float]]


@cache
def _content() -> dict[str, Any]:
    return tomllib.loads((files("wingwatch.studies.thesis") / "printed.toml").read_text(encoding="utf-8"))


@cache
def plants() -> dict[str, Plant]:
    """Plants by name."""
    return {name: _plant(name, entry) for name, entry in _content()["plants"].items()}


def _plant(name: str, entry: dict[str, Any]) -> Plant:
    a, b, c = entry["frequency"]
    return Plant(
        name,
        MODEL_STRUCTURES[entry["structure"]],
        tuple(entry["derivatives"]),
        FlightCondition(entry["airspeed_true_m_s"], entry["altitude_m"]),
        (a, b, c),
        entry["derivatives_from"],
        entry["frequency_from"],
        entry["is_the"],
    )


@cache
def printed_tables() -> dict[str, PrintedTable]:
    """Result tables by number, in the thesis's order."""
    return {entry["number"]: _table(entry) for entry in _content()["tables"]}


def _table(entry: dict[str, Any]) -> PrintedTable:
    cases = tuple(
        PrintedCase(
            case["name"], np.array(case["values"]), np.array(case["errors"]) if "errors" in case else None
        )
        for case in entry["cases"]
    )
    return PrintedTable(
        entry["number"],
        entry["section"],
        plants()[entry["plant"]],
        entry["kind"],
        entry["about"],
        entry.get("state", 0),
        cases,
    )


def printed_pulses() -> Pulses:
    """Table 7.1."""
    entry = _content()["pulses"]
    return Pulses(
        entry["number"],
        entry["section"],
        {name: (entry[name][0], entry[name][1]) for name in plants() if name in entry},
    )
