"""The grid file: what the flights of a study are drawn from.

A key that takes words takes one word, a list in which each word is equally likely, or a table of words with their
weights. A key that takes numbers takes one number, a list, or ``{ low = ..., high = ... }`` for a uniform draw, which
``logarithmic = true`` makes uniform in the logarithm and ``either_sign = true`` negative in half of the flights.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from wingwatch.simulation import EFFECTS
from wingwatch.studies.fault_names import SENSOR_EFFECTS, part_of

__all__ = [
    "KINDS",
    "Effects",
    "Grid",
    "Kind",
    "Range",
    "StudyError",
    "UNSENT",
    "bounds",
    "checked_grid",
    "default_text",
    "load_grid",
    "one_line",
]

Kind = Literal["icing", "damage", "sensor", "healthy"]
KINDS: tuple[Kind, ...] = ("icing", "damage", "sensor", "healthy")

_WORDS: Mapping[str, tuple[str, ...]] = {
    "condition": ("cruise", "envelope"),
    "route": ("straight", "patrol"),
    "turbulence": ("none", "light", "moderate", "severe", "changing"),
    "turbulence_model": ("dryden", "von-karman"),
    "excitation": ("doublet", "3211", "multisine", "autopilot", "none"),
    "sensors": ("vanes", "no_vanes"),
    "surfaces": ("positions", "commands"),
    "expectation": ("exact", "drawn"),
}
"""Words that each key takes."""

_ROUTE_OF: Mapping[str, str] = {"autopilot": "patrol", "none": "straight"}
"""Without manoeuvres only a route's turns, climbs and changes of speed excite the aircraft."""

UNSENT: Mapping[str, tuple[str, ...]] = {
    "no_vanes": ("angle_of_attack_rad", "sideslip_rad"),
    "commands": ("elevator_rad", "aileron_rad", "rudder_rad"),
}
"""Channels that a vehicle does not send, by the word of ``sensors`` or ``surfaces``."""

_EFFECTS_OF: Mapping[Kind, tuple[str, ...]] = {
    "icing": ("icing",),
    "damage": (
        "elevator_effectiveness", "aileron_effectiveness", "rudder_effectiveness", "surface_stuck", "surface_offset",
        "actuator_lag", "actuator_rate_limit", "actuator_backlash", "wing_damage", "icing", "cg_shift", "mass_inertia",
        "pitch_damping", "thrust_loss",
    ),
    "sensor": SENSOR_EFFECTS,
    "healthy": SENSOR_EFFECTS,
}  # fmt: skip
"""Ice on one side is damage as well: it is asymmetric as no other ice is."""

_OF_A_TYPE = set("[(")
"""Characters in those parts of a validation's place that are no keys."""

_LEAST_AFTER_ONSET_S = 10.0
"""One block of the monitor."""


class StudyError(ValueError):
    """A study that cannot be run, read or gone on with; one sentence."""


class Range(BaseModel):
    """A draw between two numbers.

    Attributes:
        logarithmic: uniform in the logarithm, else uniform.
        either_sign: negative in half of the flights.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    low: float
    high: float
    logarithmic: bool = False
    either_sign: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low <= self.high):
            raise ValueError(
                f"low is {self.low:g} and high is {self.high:g}; give two finite numbers in order"
            )
        if self.logarithmic and not self.low > 0.0:
            raise ValueError(f"low is {self.low:g}, which has no logarithm; give a number above 0")
        if self.either_sign and self.low < 0.0:
            raise ValueError(f"low is {self.low:g} and takes either sign already; give a number from 0")
        return self


def _weighted(given: Any) -> Any:
    if isinstance(given, str):
        return {given: 1.0}
    if isinstance(given, list) and all(isinstance(name, str) for name in given):
        return {name: float(given.count(name)) for name in given}
    if not isinstance(given, dict):
        raise ValueError(
            f"{given!r} is not understood; write a word, a list of words, or words with their weights"
        )
    return given


def _numbers(given: Any) -> Any:
    if isinstance(given, list | dict | Range):
        return given
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise ValueError(f"{given!r} is no number; write one, a list, or {{ low = ..., high = ... }}")
    return [given]


Choices = Annotated[
    dict[str, Annotated[float, Field(gt=0.0)]], BeforeValidator(_weighted), Field(min_length=1)
]
Numbers = Annotated[
    Range | Annotated[list[Annotated[float, Field(allow_inf_nan=False)]], Field(min_length=1)],
    BeforeValidator(_numbers),
]


Sizes = Annotated[
    Range | Annotated[list[Annotated[float, Field(allow_inf_nan=False)]], Field(min_length=1)] | str,
    BeforeValidator(lambda given: given if isinstance(given, str) else _numbers(given)),
]


def bounds(numbers: Range | list[float]) -> tuple[float, float]:
    """Smallest and largest number that can be drawn."""
    if isinstance(numbers, Range):
        return (-numbers.high if numbers.either_sign else numbers.low), numbers.high
    return min(numbers), max(numbers)


class Effects(BaseModel):
    """One entry of ``[[effects]]``: what may befall the aircraft.

    Attributes:
        name: of the vocabulary of causes.
        target: which surface, side, column or kind of ice; empty where the effect has only one.
        size: in the vocabulary's unit, or a word that stands for one (a surface is stuck ``here``, where it is).
        in_chords: whether ``size`` is given in mean chords, for shifts of the centre of gravity.
        weight: how often it is drawn beside the other entries.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    target: Choices = Field(default_factory=lambda: {"": 1.0})
    size: Sizes
    in_chords: bool = False
    weight: float = Field(default=1.0, gt=0.0)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.name not in EFFECTS:
            raise ValueError(f"{self.name!r} is no effect; known are {', '.join(EFFECTS)}")
        if self.in_chords and self.name != "cg_shift":
            raise ValueError(f"in_chords of {self.name}: only cg_shift is a length; leave it out")
        for target in self.target:
            for size in self._sizes():
                EFFECTS[self.name](size, target=target)
        return self

    def _sizes(self) -> tuple[float, ...]:
        """Sizes between which all others lie."""
        if not isinstance(self.size, str):
            return bounds(self.size)
        words = EFFECTS[self.name].size_words
        if self.size not in words:
            known = f" or one of {', '.join(words)}" if words else ""
            raise ValueError(
                f"size {self.size!r} of {self.name} is no number; write one, a list, a range{known}"
            )
        return (words[self.size],)


class Grid(BaseModel):
    """What the flights of one study are drawn from; the keys of the grid file (``docs/studies.md``)."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    flights: int = Field(ge=1, le=10_000_000)
    seconds: float = Field(ge=20.0, le=36_000.0)
    rate_hz: float = Field(default=50.0, ge=10.0, le=400.0)
    aircraft: Choices
    condition: Choices
    route: Choices
    turbulence: Choices
    turbulence_model: Choices
    excitation: Choices
    excitation_period_s: Numbers
    noise_scale: Numbers
    sensors: Choices
    surfaces: Choices
    expectation: Choices
    onset_s: Numbers
    ramp_s: Numbers
    icing_factor_spread: float = Field(default=0.3, ge=0.0, lt=1.0)
    healthy_weight: float = Field(default=0.0, ge=0.0)
    effects: list[Effects] = Field(default_factory=list)

    @model_validator(mode="after")
    def _known_words(self) -> Self:
        for key, known in _WORDS.items():
            for word in getattr(self, key):
                if word not in known:
                    raise ValueError(f"{key} = {word!r} is not known; give one of {', '.join(known)}")
        return self

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for excitation, route in _ROUTE_OF.items():
            if excitation in self.excitation and route not in self.route:
                raise ValueError(
                    f"excitation {excitation!r} is flown on route {route!r} only, which the grid leaves out; "
                    "add that route or leave that excitation out"
                )
        for key, least in (
            ("excitation_period_s", 5.0),
            ("noise_scale", 0.0),
            ("onset_s", 0.0),
            ("ramp_s", 0.0),
        ):
            if bounds(getattr(self, key))[0] < least:
                raise ValueError(
                    f"{key} reaches {bounds(getattr(self, key))[0]:g}; give numbers from {least:g}"
                )
        latest = bounds(self.onset_s)[1]
        if self.effects and latest > self.seconds - _LEAST_AFTER_ONSET_S:
            raise ValueError(
                f"onset_s reaches {latest:g} s in flights of {self.seconds:g} s, too late to be noticed; end it "
                f"{_LEAST_AFTER_ONSET_S:g} s before the flight's end, or fly longer"
            )
        if self.effects and not any(self.targets_of(entry) for entry in self.effects):
            raise ValueError(
                "every effect befalls a sensor that no flight has; add flights that have it to sensors or surfaces"
            )
        if not self.effects and self.healthy_weight == 0.0:
            raise ValueError("no [[effects]] and healthy_weight 0 leave nothing to draw; give one of them")
        return self

    def targets_of(self, entry: Effects) -> dict[str, float]:
        """What an effect may befall, with weights: of sensors only those that some flights of this grid have."""
        if entry.name not in SENSOR_EFFECTS:
            return dict(entry.target)
        return {
            target: weight
            for target, weight in entry.target.items()
            if self._has(part_of(entry.name, target))
        }

    def _has(self, channel: str) -> bool:
        words = (self.sensors, self.surfaces)
        return all(any(channel not in UNSENT.get(word, ()) for word in choices) for choices in words)

    def route_of(self, excitation: str) -> Mapping[str, float]:
        """The routes on which an excitation is flown, with weights."""
        only = _ROUTE_OF.get(excitation)
        return self.route if only is None else {only: 1.0}


def load_grid(kind: Kind, path: Path | None) -> Grid:
    """The default grid of a kind of study, with the keys of a file in place of its own.

    Raises:
        StudyError: a file that is no TOML, or a key, word, number or combination that cannot be.
        OSError: a file that cannot be read.
    """
    stated: dict[str, Any] = {}
    if path is not None:
        try:
            stated = tomllib.loads(path.read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise StudyError(f"{path} is no grid: {one_line(error)}") from None
    where = "the default grid" if path is None else str(path)
    return checked_grid(kind, tomllib.loads(default_text(kind)) | stated, where)


def checked_grid(kind: Kind, keys: Mapping[str, Any], where: str) -> Grid:
    """A grid from its keys; ``where`` begins the sentence that refuses one.

    Raises:
        StudyError: see ``load_grid``.
    """
    try:
        grid = Grid.model_validate(keys)
    except ValidationError as error:
        raise StudyError(f"{where}: {_first(error)}") from None
    for entry in grid.effects:
        if entry.name not in _EFFECTS_OF[kind]:
            raise StudyError(
                f"{where}: a study of {kind} has no effect {entry.name!r}; give one of {', '.join(_EFFECTS_OF[kind])}"
            )
    return grid


def _first(error: ValidationError) -> str:
    """The first of a validation's problems as a clause; an unknown key explains what misses beside it."""
    problems = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    first = problems[0]
    place = ".".join(str(part) for part in first["loc"] if not _OF_A_TYPE & set(str(part)))
    if first["type"] == "extra_forbidden":
        known = Effects.model_fields if place.startswith("effects.") else Grid.model_fields
        return f"unknown key {place!r}; known are {', '.join(known)}"
    said = one_line(first["msg"].removeprefix("Value error, "))
    return f"{place}: {said}" if place else said


def one_line(text: object) -> str:
    """A text without line breaks, as messages are said."""
    return " ".join(str(text).split())


def default_text(kind: Kind) -> str:
    """The default grid of a kind of study, as the text of a grid file."""
    return (Path(__file__).parent / "grids" / f"{kind}.toml").read_text(encoding="utf-8")
