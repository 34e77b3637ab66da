"""An effect: how far it has grown at a time, and what it changes of the aircraft and of its sensors."""

import math
from abc import ABC
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, AircraftDataError, FlightCondition
from wingwatch.simulation.layout import INDEX, parameter_row

__all__ = ["Effect", "Parameters", "SensorFault", "freeze_s", "parameters_under"]


class Parameters:
    """A parameter row (``layout.PARAMETERS``) by name, for effects to change.

    Attributes:
        aircraft: whose parameters they are, as its file describes it.
        condition: where it flies.
        row: shape (len(PARAMETERS),).
    """

    __slots__ = ("aircraft", "condition", "row")

    def __init__(self, aircraft: Aircraft, condition: FlightCondition, row: NDArray[np.float64]) -> None:
        self.aircraft = aircraft
        self.condition = condition
        self.row = row

    def __getitem__(self, name: str) -> float:
        return float(self.row[INDEX[name]])

    def __setitem__(self, name: str, value: float) -> None:
        self.row[INDEX[name]] = value

    def scale(self, factors: Mapping[str, float], severity: float) -> None:
        """Each named parameter times 1 + severity times its factor."""
        for name, factor in factors.items():
            self[name] *= 1.0 + severity * factor

    def need_one_of(self, names: Sequence[str], what: str) -> None:
        """AircraftDataError where all of the named parameters are zero, so that a ratio would change nothing."""
        if all(self[name] == 0.0 for name in names):
            raise AircraftDataError(
                f"{what} changes nothing on aircraft {self.aircraft.name}, whose {', '.join(names)} "
                f"{'is' if len(names) == 1 else 'are'} zero; simulate another effect or state a coefficient"
            )


@dataclass(frozen=True, slots=True)
class SensorFault:
    """What one sensor reads once an effect has reached severity 1; it grows in proportion to the severity.

    reading = (1 + severity scale) (truth, ``severity delay_s`` late) + severity bias

    Attributes:
        column: of the flight table.
        bias: in the column's unit.
        scale: ratio minus 1.
        delay_s: s.
        frozen: after the onset the reading stays the last one up to it, whatever else befalls the sensor.
    """

    column: str
    bias: float = 0.0
    scale: float = 0.0
    delay_s: float = 0.0
    frozen: bool = False


@dataclass(frozen=True, slots=True)
class Effect(ABC):
    """Something that befalls an aircraft: it changes parameters of its flight, readings of its sensors, or both.

    Attributes:
        size: severity once it is fully there (meaning and range: each effect).
        onset_s: when it starts, in the flight's time.
        ramp_s: how long it grows, linearly; 0 for a step.
        target: which surface, column or derivative, where the effect has several (``targets``).

    Raises:
        ValueError: a size outside the effect's range, a time that is negative or not finite, a ramp of what cannot
            grow, an unknown target.
    """

    size: float
    onset_s: float = 0.0
    ramp_s: float = 0.0
    target: str = ""

    name: ClassVar[str]
    size_min: ClassVar[float] = 0.0
    size_max: ClassVar[float]
    size_meaning: ClassVar[str]
    size_words: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Sizes that are written as a word, beside the range."""
    targets: ClassVar[tuple[str, ...]] = ()
    """What it can befall; empty for an effect that is one of its kind."""
    target_default: ClassVar[str] = ""
    """What it befalls where nothing is said."""
    grows: ClassVar[bool] = True
    """Whether it may come over a ramp, and is nothing at size 0; otherwise it is there at once, whatever its size."""

    def __post_init__(self) -> None:
        if not self.target:
            object.__setattr__(self, "target", self.target_default)
        if math.isnan(self.size) and self.word is not None:
            object.__setattr__(
                self, "size", math.nan
            )  # one and the same object, so that effects compare as equal
        if not self.size_min <= self.size <= self.size_max and self.word is None:
            words = "".join(f", or {word}" for word in self.size_words)
            span = f", {self.size_min:g} to {self.size_max:g}" if self.size_min < self.size_max else ""
            raise ValueError(f"{self.name} has size {self.size}; give {self.size_meaning}{span}{words}")
        for what, value in (("start", self.onset_s), ("ramp", self.ramp_s)):
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{self.name} has {what} {value} s; give a number of seconds from 0")
        if self.ramp_s > 0.0 and not self.grows:
            raise ValueError(f"{self.name} has ramp {self.ramp_s} s, but is there at once; give no ramp")
        if self.target and not self.targets:
            raise ValueError(f"{self.name} of {self.target!r} cannot be simulated; it takes no target")
        if self.targets and not self.knows(self.target):
            what = f"of {self.target!r}" if self.target else "of nothing"
            raise ValueError(f"{self.name} {what} cannot be simulated; give one of {', '.join(self.targets)}")

    @property
    def word(self) -> str | None:
        """The size as a word, None where it is a number like any other."""
        for word, size in self.size_words.items():
            if self.size == size or (math.isnan(self.size) and math.isnan(size)):
                return word
        return None

    def knows(self, target: str) -> bool:
        """Whether it can befall a target."""
        return target in self.targets

    def severity(self, time_s: float) -> float:
        """How much of it there is at a time: 0 before the onset, ``size`` after the ramp."""
        since = time_s - self.onset_s
        if since < 0.0:
            return 0.0
        return self.size if since >= self.ramp_s else self.size * since / self.ramp_s

    def acts(self, time_s: float) -> bool:
        """Whether anything of it is there at a time; a surface may be stuck at deflection 0."""
        return time_s >= self.onset_s and not (self.grows and self.severity(time_s) == 0.0)

    def apply(self, parameters: Parameters, severity: float) -> None:  # noqa: B027 - most spoil one or the other
        """Change the parameters as an effect of that severity does; nothing by default."""

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """What the sensors read at severity 1; nothing by default."""
        return ()


def parameters_under(
    aircraft: Aircraft,
    condition: FlightCondition,
    effects: Sequence[Effect],
    time_s: float,
    clean: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """The aircraft's parameters at a time under effects, applied in their order; shape (len(PARAMETERS),).

    Args:
        aircraft: the type.
        condition: where it flies.
        effects: what befalls it.
        time_s: when.
        clean: its parameters without effects; those of its file where nothing is given.

    Raises:
        AircraftDataError: an effect that this aircraft cannot suffer; the sentence says why.
    """
    parameters = Parameters(aircraft, condition, parameter_row(aircraft) if clean is None else clean.copy())
    for effect in effects:
        if effect.acts(time_s):
            effect.apply(parameters, effect.severity(time_s))
    return parameters.row


def freeze_s(effects: Iterable[Effect], column: str) -> float:
    """Time after which a column's reading is frozen: the first onset of such a fault, infinite without one."""
    onsets_s = (
        effect.onset_s
        for effect in effects
        for fault in effect.sensor_faults()
        if fault.frozen and fault.column == column
    )
    return min(onsets_s, default=math.inf)
