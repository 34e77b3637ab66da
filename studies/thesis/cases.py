"""Cases of the thesis's tables, repeated: plant, input, noise, record length and estimator, by the name of the case."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import ModeStructure, natural_frequency_and_damping, state_matrix
from wingwatch.estimators.offline.fit import channel_fit
from wingwatch.simulation import linear_response, state_rates
from wingwatch.studies.thesis.methods import (
    BAND_HZ,
    WIDE_HZ,
    Answer,
    differentiated,
    in_frequency,
    online,
    reconstructed,
)
from wingwatch.studies.thesis.printed import Plant, plants
from wingwatch.studies.thesis.records import RATE_HZ, Flown, Record, doublet, flown, jetstream_input, measured

__all__ = ["Case", "Outcome", "case_of", "frequencies", "outcome"]

Array = NDArray[np.float64]

_SHORT_S, _LONG_S = 5.0, 12.0
_JETSTREAM_S = {"q": 15.0, "r": 20.0}
_METHODS: dict[str, Callable[[Record], Answer]] = {
    "differentiated": differentiated,
    "reconstructed": reconstructed,
    "to 12 Hz": partial(in_frequency, band_hz=WIDE_HZ),
    "to 4 Hz": partial(in_frequency, band_hz=BAND_HZ),
}
_FOUR_STATES = "not repeated: the roll derivatives of a model of four states are not printed for this plant"
_PLANT_IN_PLACE = "the flight record is not public: the plant of table {} stands in, with signal-to-noise 5"
_INPUT_IN_PLACE = {
    "q": "the recorded elevator is not public: impulses of 0.3 s up at 1.5 s and down at 9.5 s stand in, record 15 s",
    "r": "the recorded rudder is not public: a sine of 2 degrees and 2.2 rad/s from 4 to 13 s stands in, record 20 s",
}


@dataclass(frozen=True, slots=True)
class Case:
    """One case.

    Attributes:
        plant, name: which.
        seconds: length of the record.
        noisy: whether white noise at signal-to-noise 5 is on velocity, rate and accelerometer.
        jetstream: whether the input is that of the Jetstream's flights (its stand-in) rather than the doublet.
        delayed: whether the Jetstream's sensor delays are left in.
        missing: why it cannot be repeated, else empty.
    """

    plant: Plant
    name: str
    seconds: float
    noisy: bool
    jetstream: bool
    delayed: bool
    missing: str

    @property
    def notes(self) -> tuple[str, ...]:
        """What stands in for what the thesis does not give; a clause each."""
        said = []
        if self.plant.flown:
            said.append(_PLANT_IN_PLACE.format(self.plant.derivatives_from))
        if self.jetstream:
            said.append(_INPUT_IN_PLACE[self.plant.structure.states[1]])
        return (*said, *filter(None, [self.missing]))


@dataclass(frozen=True, slots=True)
class Outcome:
    """A case repeated over draws of noise, seeds 0, 1, ...; one draw without noise.

    Attributes:
        value, error: derivatives and their standard errors, (draws, 6).
        r_squared: of the two equations, percent, (draws, 2).
        r_squared_clean: of the estimated model's state derivatives, flown from the surface alone, against those of the
            plant without noise, percent, (draws, 2).
        theil: coefficient, bias, variance, covariance of the two states as predicted, (draws, 2, 4).
        frequency, frequency_error: natural and damped frequency and damping ratio, (draws, 3).
    """

    value: Array
    error: Array
    r_squared: Array
    r_squared_clean: Array
    theil: Array
    frequency: Array
    frequency_error: Array


def case_of(plant: Plant, name: str) -> Case:
    """The case of a name such as ``differentiated, noise`` or ``online 0.998, noise, Jetstream input``."""
    method, *flags = name.split(", ")
    jetstream = plant.flown or "Jetstream input" in flags
    seconds = _SHORT_S if method in ("differentiated", "reconstructed") else _LONG_S
    if jetstream:
        seconds = _JETSTREAM_S[plant.structure.states[1]]
    missing = _FOUR_STATES if "four states" in flags else ""
    return Case(plant, name, seconds, "clean" not in flags, jetstream, "delayed" in flags, missing)


@cache
def outcome(plant_name: str, name: str, draws: int) -> Outcome:
    """The case repeated; kept, because several tables show the same case.

    Args:
        plant_name: key of ``plants()``.
        name: of the case, one that can be repeated.
        draws: of noise, at least 1.
    """
    case = case_of(plants()[plant_name], name)
    flight = flight_of(case)
    method = _method(name)
    seeds: list[int | None] = list(range(draws)) if case.noisy else [None]
    found = []
    for seed in seeds:
        record = measured(flight, seed)
        answer = method(record)
        found.append((answer, theil(record, answer.value), *frequencies(case.plant.structure, answer)))
    return Outcome(
        np.array([a.value for a, *_ in found]),
        np.array([a.standard_error for a, *_ in found]),
        100.0 * np.array([a.r_squared for a, *_ in found]),
        100.0 * np.array([_against_clean(flight, a.value) for a, *_ in found]),
        np.array([t for _, t, *_ in found]),
        np.array([f for *_, f, _ in found]),
        np.array([e for *_, e in found]),
    )


def flight_of(case: Case) -> Flown:
    """What the plant of a case does."""
    surface = (jetstream_input if case.jetstream else doublet)(case.plant, case.seconds)
    return flown(case.plant, surface, delayed=case.delayed)


def _method(name: str) -> Callable[[Record], Answer]:
    first = name.partition(", ")[0]
    if first.startswith("online "):
        return partial(online, forgetting=float(first.removeprefix("online ")))
    return _METHODS[first]


def theil(record: Record, value: Array) -> Array:
    """Theil's coefficient and its three shares of both states, the model flown from the surface alone, (2, 4)."""
    structure = record.flown.plant.structure
    by_symbol = dict(zip(structure.derivatives, value.tolist(), strict=True))
    with np.errstate(over="ignore", invalid="ignore"):
        predicted = linear_response(structure, by_symbol, record.flown.surface, 1.0 / RATE_HZ)
    fits = [
        channel_fit(name, [record.states[:, k]], [predicted[:, k]]) for k, name in enumerate(structure.states)
    ]
    return np.array([(f.tic, f.bias, f.variance, f.covariance) for f in fits])


def _against_clean(flight: Flown, value: Array) -> Array:
    """R2 of the model's state derivatives against the plant's, neither with noise, (2,)."""
    structure, surface = flight.plant.structure, flight.surface
    rates = []
    for derivatives in (flight.plant.derivatives, tuple(value.tolist())):
        by_symbol = dict(zip(structure.derivatives, derivatives, strict=True))
        with np.errstate(over="ignore", invalid="ignore"):
            states = linear_response(structure, by_symbol, surface, 1.0 / RATE_HZ)
            rates.append(state_rates(structure, by_symbol, states, surface))
    own, model = rates
    return np.asarray(1.0 - np.mean((model - own) ** 2, axis=0) / np.var(own, axis=0))


def frequencies(structure: ModeStructure, answer: Answer) -> tuple[Array, Array]:
    """Natural and damped frequency and damping ratio, with standard errors of first order, both (3,)."""
    steps = 1e-4 * np.maximum(answer.standard_error, 1e-6 * np.abs(answer.value))
    slopes = np.array(
        [
            (_modes(structure, answer.value + e) - _modes(structure, answer.value - e)) / (2.0 * s)
            for s, e in zip(steps, np.diag(steps), strict=True)
        ]
    )
    spread = slopes.T @ answer.covariance @ slopes
    return _modes(structure, answer.value), np.sqrt(np.maximum(np.diagonal(spread), 0.0))


def _modes(structure: ModeStructure, value: Array) -> Array:
    by_symbol = dict(zip(structure.derivatives, value.tolist(), strict=True))
    natural, damping = natural_frequency_and_damping(structure, state_matrix(structure, by_symbol))
    damped = natural * math.sqrt(1.0 - damping**2) if abs(damping) < 1.0 else math.nan
    return np.array([natural, damped, damping])
