"""The forms of estimation that the thesis compares, with wingwatch's estimators, on one record."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    EquationErrorConfig,
    Estimate,
    Fit,
    FourierConfig,
    FourierEstimator,
    FrequencyEquationErrorConfig,
    Manoeuvre,
    ManoeuvreConfig,
    SignalLayout,
    equation_error,
    frequency_equation_error,
    manoeuvres,
    output_error,
)
from wingwatch.studies.thesis.printed import Plant
from wingwatch.studies.thesis.records import RATE_HZ, Record

__all__ = [
    "BAND_HZ",
    "SOLVE_EVERY",
    "WIDE_HZ",
    "Answer",
    "differentiated",
    "ekf_estimator",
    "in_frequency",
    "online",
    "online_estimator",
    "online_trace",
    "output_errors",
    "reconstructed",
]

Array = NDArray[np.float64]

BAND_HZ, WIDE_HZ = (0.1, 4.0), (0.1, 12.0)
SOLVE_EVERY = 25
"""Samples between solutions: 2 Hz (thesis 9.2)."""
_CUTOFF_HZ = 4.0
_FORGETTING_HZ = 25.0
"""Samples a second that the thesis's forgetting factor counts in."""
_LIVE_MEMORY_S, _ENDLESS_S = 40.0, 1e9
_START_AT, _WIDTH = 0.7, 3.0
"""Online estimators start 30 % off, with a prior three times as wide as a derivative's size."""
_LAYOUT = SignalLayout(2, 1)


@dataclass(frozen=True, slots=True)
class Answer:
    """Derivatives from one record.

    Attributes:
        value: (6,).
        covariance: (6, 6).
        r_squared: of the two equations' left sides, (2,); NaN where the form has none.
    """

    value: Array
    covariance: Array
    r_squared: Array

    @property
    def standard_error(self) -> Array:
        """(6,)."""
        return np.sqrt(np.diagonal(self.covariance))


def _answer(estimate: Estimate, fit: Fit | None = None) -> Answer:
    nothing = np.full(2, math.nan)
    return Answer(
        estimate.value,
        estimate.covariance,
        nothing if fit is None else np.array([channel.r_squared for channel in fit.channels[:2]]),
    )


def _reference(plant: Plant) -> tuple[float, float]:
    return plant.condition.airspeed_true_m_s, plant.condition.air_density_kg_m3


def _parts(plant: Plant, rows: Array, *, by_accelerometer: bool = False) -> tuple[Manoeuvre, ...]:
    config = ManoeuvreConfig(
        plant.structure,
        _reference(plant),
        held=(True,),
        window_s=len(rows) / RATE_HZ,
        use_accelerometer=by_accelerometer,
    )
    return manoeuvres(config, rows)


def differentiated(record: Record) -> Answer:
    """Equation error in the time domain, both states differentiated below 4 Hz (thesis 7.4)."""
    parts = _parts(record.flown.plant, record.rows)
    return _answer(*equation_error(parts, EquationErrorConfig(cutoff_hz=_CUTOFF_HZ)))


def reconstructed(record: Record) -> Answer:
    """The same with the velocity from the accelerometer, integrated by trapezoids (thesis 7.2)."""
    rows = record.rows.copy()
    rate = rows[:, _LAYOUT.accelerometer] + rows[:, _LAYOUT.kinematic]
    rows[0, 1], rows[1:, 1] = 0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1])) / RATE_HZ
    rows[:, _LAYOUT.kinematic + 6] = 0.0
    parts = _parts(record.flown.plant, rows, by_accelerometer=True)
    return _answer(*equation_error(parts, EquationErrorConfig(cutoff_hz=_CUTOFF_HZ)))


def in_frequency(record: Record, band_hz: tuple[float, float]) -> Answer:
    """Equation error in the frequency domain over a band (thesis chapter 8)."""
    parts = _parts(record.flown.plant, record.rows)
    return _answer(*frequency_equation_error(parts, FrequencyEquationErrorConfig(band_hz)))


def output_errors(record: Record) -> Answer:
    """Output error from velocity and rate, which the thesis describes (5.3) and does not use."""
    return _answer(output_error(_parts(record.flown.plant, record.rows))[0])


def _prior(plant: Plant) -> tuple[Array, Array]:
    truth = np.array(plant.derivatives)
    start = _START_AT * truth
    start[1] -= plant.turn
    return start, np.abs(truth)


def online_estimator(
    plant: Plant, forgetting: float | None, *, accelerometer: bool = False
) -> FourierEstimator:
    """The recursive Fourier estimator with the memory that a forgetting factor a sample of 25 Hz means.

    Args:
        plant: gives structure and condition, and a prior 30 % off.
        forgetting: the factor; None for the memory of the live chain.
        accelerometer: whether the force equation rests on it, as live, rather than on the velocity's rate.
    """
    start, size = _prior(plant)
    memory_s = _LIVE_MEMORY_S
    if forgetting is not None:
        memory_s = 1.0 / (_FORGETTING_HZ * (1.0 - forgetting)) if forgetting < 1.0 else _ENDLESS_S
    return FourierEstimator(
        FourierConfig(
            plant.structure,
            BAND_HZ,
            start,
            _WIDTH * size,
            _reference(plant),
            memory_s=memory_s,
            held=(True,),
            force_from_accelerometer=accelerometer,
        )
    )


def ekf_estimator(plant: Plant, *, accelerometer: bool = False) -> EkfEstimator:
    """The filter with the live chain's memory."""
    start, size = _prior(plant)
    return EkfEstimator(
        EkfConfig(
            plant.structure, start, size, _reference(plant), held=(True,), use_accelerometer=accelerometer
        )
    )


def online_trace(estimator: FourierEstimator | EkfEstimator, rows: Array) -> Iterator[tuple[float, Estimate]]:
    """Time and estimate after each solution."""
    state = estimator.init(1)
    for k in range(0, len(rows), SOLVE_EVERY):
        estimator.update(state, rows[None, k : k + SOLVE_EVERY])  # type: ignore[arg-type]
        estimator.solve(state)  # type: ignore[arg-type]
        yield float(rows[min(k + SOLVE_EVERY, len(rows)) - 1, 0]), estimator.estimate(state, 0)  # type: ignore[arg-type]


def online(record: Record, forgetting: float) -> Answer:
    """The last estimate of the recursive Fourier estimator (thesis chapter 9)."""
    *_, (_, last) = online_trace(online_estimator(record.flown.plant, forgetting), record.rows)
    return _answer(last)
