"""Measured motion of each manoeuvre against that of the linear model with given derivatives.

The model flies open loop through still air by the measured surfaces. Its initial state, trim constants and
accelerometer biases are fitted by least squares, as output error has them; derivatives are not.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import SURFACE_OF_INPUT, Aircraft, AircraftDataError, ModeStructure, analysis_band_hz
from wingwatch.diagnosis.offline_estimates import flight_form
from wingwatch.diagnosis.tracking import Track, untracked
from wingwatch.estimators import Form, Manoeuvre, flight_manoeuvres, missing_channels, offsets, referred_scale
from wingwatch.estimators.offline.fit import channel_fit
from wingwatch.estimators.offline.output_error import response
from wingwatch.estimators.offline.regression import common_forces, noise_names, sensor_noise
from wingwatch.monitor.estimation.chain import nominal_condition
from wingwatch.telemetry import INPUT_CHANNELS, FlightTable, SampleBlock

__all__ = ["Derivatives", "MotionChannel", "PredictedManoeuvre", "predicted_motion"]

Array = NDArray[np.float64]

_LEAST_RAD = 2e-3
_OF_LARGEST = 0.3
"""A window is a manoeuvre where a surface moves by so much (rms), and by this part of its largest window."""


_TRIM_S = 2.0
"""What is slower is trim."""


@dataclass(frozen=True, slots=True)
class Derivatives:
    """Concise derivatives of one structure, (k,) each.

    Attributes:
        value: as estimated; expected: by the baseline. NaN where not known.
        estimator: whose the estimate is.
        condition: airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad that both hold at.
    """

    value: Array
    expected: Array
    estimator: str
    condition: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class MotionChannel:
    """One output over a manoeuvre, (n,) each.

    Attributes:
        name: ``w``, ``q``, ``a_z`` and so on, as output error has them.
        estimated, expected: of the model by the derivatives estimated and expected; NaN where they are not known.
        r_squared, r_squared_expected: part of the measured variation that each of them follows.
        tic: Theil's coefficient of the first.
        over_noise: rms of what the first leaves over that of the sensor's own noise; 1 is perfect, NaN where the noise
            is not known.
    """

    name: str
    measured: Array
    estimated: Array
    expected: Array
    r_squared: float
    r_squared_expected: float
    tic: float
    over_noise: float


@dataclass(frozen=True, slots=True)
class PredictedManoeuvre:
    """One manoeuvre of one structure.

    Attributes:
        moved_rad: rms of the surface that moved most, slow trim left out.
        estimator: whose derivatives were taken.
    """

    structure: str
    time_s: Array
    moved_rad: float
    estimator: str
    channels: tuple[MotionChannel, ...]


Known = Callable[[ModeStructure, float], Derivatives | None]
"""The derivatives of a structure as they were known at an instant."""


def predicted_motion(
    flight: FlightTable,
    aircraft: Aircraft,
    clean: SampleBlock,
    structures: Sequence[ModeStructure],
    known: Known,
    track: Track = untracked,
) -> tuple[list[PredictedManoeuvre], list[str]]:
    """Manoeuvres in which a surface moved, in the order of time by structure, and what could not be predicted.

    Args:
        flight, clean: as loaded, and its accepted samples.
        structures: estimated in the flight; a surface that it lacks is taken to rest.
        known: asked at the end of each manoeuvre.
    """
    found: list[PredictedManoeuvre] = []
    notes: list[str] = []
    for structure in track(structures, "predicting the motion"):
        try:
            found += _of_structure(flight, aircraft, clean, structure, known)
        except (ValueError, AircraftDataError) as error:
            notes.append(f"{structure.name}: {error}")
    return found, notes


def _of_structure(
    flight: FlightTable, aircraft: Aircraft, clean: SampleBlock, structure: ModeStructure, known: Known
) -> list[PredictedManoeuvre]:
    nominal = nominal_condition(aircraft)
    if nominal is None:
        raise ValueError(f"aircraft {aircraft.name} states neither [envelope] nor [[conditions]]; add one")
    block = _with_resting_surfaces(clean, structure)
    form: Form = "reconstructed" if missing_channels(structure, block.present) else "accelerometer"
    if missing := missing_channels(structure, block.present, form):
        raise ValueError(f"missing {', '.join(missing)}")
    shape = flight_form(flight, aircraft, nominal, form, analysis_band_hz(aircraft, structure))
    parts = flight_manoeuvres(structure, shape, [block])
    moved = np.array([_moved(part) for part in parts]).reshape(len(parts), -1)
    least = np.maximum(_LEAST_RAD, _OF_LARGEST * moved.max(axis=0, initial=0.0))
    found = []
    for part, size in zip(parts, moved, strict=True):
        if (size < least).all():
            continue
        derivatives = known(structure, float(part.time_s[-1]))
        if derivatives is not None:
            found.append(_predicted(part, derivatives, float(size.max())))
    if not found:
        raise ValueError("no surface of the mode moved enough once its derivatives had converged")
    return found


def _moved(part: Manoeuvre) -> Array:
    """Rms of each input about its running mean: an autopilot that trims a climb excites nothing."""
    length = max(3, min(len(part), round(_TRIM_S / part.dt)))
    window = np.ones(length) / length
    norm = np.convolve(np.ones(len(part)), window, mode="same")
    slow = [np.convolve(column, window, mode="same")[: len(part)] / norm for column in part.inputs.T]
    return np.asarray(np.sqrt(np.mean((part.inputs - np.column_stack(slow)) ** 2, axis=0)))


def _with_resting_surfaces(clean: SampleBlock, structure: ModeStructure) -> SampleBlock:
    surfaces = [INPUT_CHANNELS[u] for u in structure.inputs if u in SURFACE_OF_INPUT]
    lacking = [name for name in surfaces if name not in clean.present]
    if not lacking or len(lacking) == len(surfaces):
        return clean
    columns = {name: clean.column(name) for name in clean.present}
    return SampleBlock.from_columns({**columns, **{name: np.zeros(len(clean)) for name in lacking}})


def _predicted(part: Manoeuvre, derivatives: Derivatives, moved_rad: float) -> PredictedManoeuvre:
    estimated, expected = (
        response(part, _referred(part, value, derivatives.condition))
        for value in (derivatives.value, derivatives.expected)
    )
    noise = dict(
        zip(noise_names(part.config), sensor_noise([part], common_forces([part])).tolist(), strict=True)
    )
    channels = []
    for name, (measured, predicted) in estimated.items():
        r_squared, tic = _fit(name, measured, predicted)
        beside = expected[name][1]
        channels.append(
            MotionChannel(
                name, measured, predicted, beside, r_squared, _fit(name, measured, beside)[0], tic,
                _over(measured - predicted, noise[name]),
            )
        )  # fmt: skip
    return PredictedManoeuvre(
        part.config.structure.name, part.time_s, moved_rad, derivatives.estimator, tuple(channels)
    )


def _referred(part: Manoeuvre, value: Array, condition: tuple[float, float, float, float]) -> Array:
    """Aerodynamic derivatives at the reference of the manoeuvre, from concise ones at another condition."""
    structure = part.config.structure
    airspeed, _, density, alpha = condition
    own = value - offsets(structure, airspeed, alpha)
    return np.asarray(own / referred_scale(structure, airspeed, density, part.config.reference))


def _over(left: Array, noise_variance: float) -> float:
    """Rms over that of the noise."""
    size = float(np.std(left))
    return size / math.sqrt(noise_variance) if noise_variance > 0.0 and math.isfinite(size) else math.nan


def _fit(name: str, measured: Array, predicted: Array) -> tuple[float, float]:
    """Coefficient of determination and Theil's coefficient; NaN without a prediction."""
    if not np.isfinite(predicted).all():
        return float("nan"), float("nan")
    fit = channel_fit(name, [measured], [predicted])
    return fit.r_squared, fit.tic
