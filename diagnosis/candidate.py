"""A candidate cause: parameters, and how they enter the simulation. Each kind is one file of ``causes``."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.measured import FORCE_X, OUTPUTS, MeasuredFlight
from wingwatch.diagnosis.replay import Model
from wingwatch.simulation.layout import PARAMETERS

__all__ = ["INDEX", "Candidate", "FreeParameter", "Subject", "no_change", "output_index", "scale", "updated"]

Array = NDArray[np.float64]

_EITHER = re.compile(r"\[([^|\]]*)\|([^\]]*)\]")

_Table = TypeVar("_Table", bound=BaseModel)

INDEX: Mapping[str, int] = {name: i for i, name in enumerate(PARAMETERS)}


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """A parameter that is 0 where the cause is absent.

    Attributes:
        name, unit: as reported.
        step: for differences: small beside what matters.
        spread: standard deviation of what is expected of such a fault.
        least: size below which the cause makes no difference that matters.
        low, high: limits.
        inverse: whether it is one over what is reported, which is infinite where the cause is absent.
    """

    name: str
    unit: str
    step: float
    spread: float
    least: float
    low: float = -np.inf
    high: float = np.inf
    inverse: bool = False


@dataclass(frozen=True, slots=True)
class Subject:
    """What is diagnosed.

    Attributes:
        aircraft: its file, made whole where it states derivatives without mass or geometry.
        stated: its file as it is.
        flight: measured.
        model: the simulation as stated.
        throttle_known: whether thrust is simulated.
        trims_known: whether the file states forces and moments of steady flight, not only derivatives.
        followed: states of ``START`` that the simulation has no equations for: they are taken from measurement.
    """

    aircraft: Aircraft
    stated: Aircraft
    flight: MeasuredFlight
    model: Model
    throttle_known: bool
    trims_known: bool
    followed: tuple[int, ...] = ()

    @property
    def given(self) -> int:
        """How many outputs move the aircraft instead of being predicted: the force along x, which no derivative of a
        structure states, where its accelerometer is there."""
        return int(self.aircraft.coefficients is None and FORCE_X in self.flight.compared)

    def measures(self, channel: str) -> bool:
        """Whether an output is compared."""
        return OUTPUTS.index(channel) in self.flight.compared

    def states(self, parameter: str) -> bool:
        """Whether a parameter of the simulation is not zero."""
        return bool(self.model.row[INDEX[parameter]] != 0.0)


def no_change(aircraft: Aircraft, values: Array) -> Aircraft | None:
    """The aircraft file has no place for it."""
    return None


@dataclass(frozen=True, slots=True)
class Candidate:
    """A cause that may be found.

    Attributes:
        name: of the vocabulary of causes; target: what of it, empty where the name says all.
        parameters: what is estimated.
        change: changes a model as the cause does at given values.
        says: what an operator reads, with ``{0}``, ``{1}`` for the values (``sentence``).
        mend: the aircraft file with the cause in it; None where it has no place for it.
        odds: prior odds beside other causes.
    """

    name: str
    target: str
    parameters: tuple[FreeParameter, ...]
    change: Callable[[Model, Array], None]
    says: str
    mend: Callable[[Aircraft, Array], Aircraft | None] = no_change
    odds: float = 1.0

    @property
    def label(self) -> str:
        """Name, with the target in brackets."""
        return f"{self.name}[{self.target}]" if self.target else self.name

    def sentence(self, values: Array) -> str:
        """What an operator reads: of ``[more|less]`` the first word, or the second and sizes without sign below 0."""
        if "|" not in self.says:
            return self.says.format(*values)
        word = 1 if values[0] >= 0.0 else 2
        return _EITHER.sub(lambda match: match[word], self.says).format(*np.abs(values))


def output_index(channel: str) -> int:
    """Place of an output."""
    return OUTPUTS.index(channel)


def scale(model: Model, factors: Mapping[str, float], size: float) -> None:
    """Each parameter times 1 + its factor times size."""
    for name, factor in factors.items():
        model.row[INDEX[name]] *= 1.0 + factor * size


def updated(record: _Table, **changes: object) -> _Table:
    """A table of the aircraft file with other entries, checked again."""
    return type(record).model_validate(record.model_dump() | changes)
