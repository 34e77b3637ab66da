"""Estimates of a whole flight at once: equation error, in time or in frequency, output error and filter error."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    MODEL_STRUCTURES,
    STRUCTURES,
    SURFACE_OF_INPUT,
    Aircraft,
    AircraftDataError,
    FlightCondition,
    ModeStructure,
    analysis_band_hz,
    mode_quantities,
)
from wingwatch.baselines import Envelope, Expectation, OutOfEnvelope, apriori_envelope
from wingwatch.diagnosis.measured import DiagnosisError
from wingwatch.diagnosis.tracking import Track, untracked
from wingwatch.estimators import (
    EquationErrorConfig,
    Estimate,
    FilterErrorConfig,
    Fit,
    FlightForm,
    Form,
    FrequencyEquationErrorConfig,
    Manoeuvre,
    correlated_pairs,
    equation_error,
    filter_error,
    flight_manoeuvres,
    frequency_equation_error,
    in_form,
    inertia_coupling,
    missing_channels,
    offsets,
    output_error,
    solved_as,
)
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.estimation.chain import nominal_condition
from wingwatch.monitor.vehicle.mode_object import mode_object
from wingwatch.telemetry import FlightTable, SampleBlock

__all__ = [
    "OFFLINE_ESTIMATORS",
    "OfflineEstimates",
    "Solve",
    "estimate_offline",
    "flight_form",
    "structure_solver",
]

OFFLINE_ESTIMATORS = ("equation-error", "frequency-equation-error", "output-error", "filter-error")


_CYCLES, _SHORTEST_WINDOW_S = 1.2, 12.0
"""Length of a manoeuvre: cycles of the band's lowest frequency, and at least so many seconds."""

_FILTER_WINDOW_S = 30.0
"""The same for the filter, whose air and moments do not stop at a window's edge."""

Solve = Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]


@dataclass(frozen=True, slots=True)
class OfflineEstimates:
    """What one estimator made of a flight.

    Attributes:
        monitor: not fed; knows how samples were cleaned.
        flight: the flight.
        modes: the contract's object of each structure, with modes and the statistics of its fit.
        absent: why a structure is not estimated.
        last_s: stamp of the last sample used.
    """

    monitor: VehicleMonitor
    flight: FlightTable
    modes: Mapping[str, dict[str, Any]]
    absent: Mapping[str, str]
    last_s: float


def estimate_offline(
    flight: FlightTable,
    aircraft: Aircraft,
    estimator: str,
    track: Track = untracked,
    *,
    structures: Sequence[str] = (),
    form: Form = "accelerometer",
) -> OfflineEstimates:
    """Structures of a flight by one of ``OFFLINE_ESTIMATORS``.

    Args:
        flight: as loaded.
        aircraft: whose derivatives are expected.
        estimator: one of ``OFFLINE_ESTIMATORS``.
        track: shows the structures.
        structures: names in ``MODEL_STRUCTURES``; those that are watched live where empty.
        form: of the force equations, see ``FlightForm``.

    Raises:
        DiagnosisError: no structure can be estimated.
    """
    numbers = iter(range(1, 1 + len(flight.block)))
    monitor = VehicleMonitor(
        aircraft, "default", "offline", flight.block.present, flight.kinds,
        new_id=lambda: f"alert-{next(numbers)}",
    )  # fmt: skip
    clean = monitor.prepared(flight.block)
    chosen = [MODEL_STRUCTURES[name] for name in structures or STRUCTURES]
    modes: dict[str, dict[str, Any]] = {}
    absent: dict[str, str] = {}
    for structure in track(chosen, "estimating"):
        missing = missing_channels(structure, flight.block.present, form)
        if missing:
            absent[structure.name] = f"missing {', '.join(missing)}"
            continue
        try:
            modes[structure.name] = _estimated(flight, aircraft, estimator, structure, form, clean)
        except (ValueError, AircraftDataError) as error:
            absent[structure.name] = str(error)
    if not modes:
        reasons = "; ".join(f"{name}: {why}" for name, why in absent.items())
        raise DiagnosisError(f"{flight.source}: no mode can be estimated ({reasons})")
    return OfflineEstimates(monitor, flight, modes, absent, float(clean.time_s[-1]))


def _estimated(
    flight: FlightTable,
    aircraft: Aircraft,
    estimator: str,
    structure: ModeStructure,
    form: Form,
    clean: SampleBlock,
) -> dict[str, Any]:
    """One structure's object; ValueError says why there is none."""
    shape, solve = structure_solver(flight, aircraft, structure, estimator, form)
    parts = flight_manoeuvres(structure, shape, [clean])
    if not parts:
        raise ValueError("there are not two seconds of whole samples in a row")
    estimate, fit = in_form(*solve(parts), structure)
    return _mode(aircraft, apriori_envelope(aircraft, structure), estimate, fit)


def structure_solver(
    flight: FlightTable, aircraft: Aircraft, structure: ModeStructure, estimator: str, form: Form
) -> tuple[FlightForm, Solve]:
    """How a flight becomes manoeuvres of a structure, and what estimates ``solved_as`` it from them.

    Raises:
        ValueError: the aircraft states no condition to which derivatives are referred.
    """
    nominal = nominal_condition(aircraft)
    if nominal is None:
        raise ValueError(f"aircraft {aircraft.name} states neither [envelope] nor [[conditions]]; add one")
    solved = solved_as(structure)
    band_hz = analysis_band_hz(aircraft, solved)
    shape = flight_form(flight, aircraft, nominal, form, band_hz)
    if estimator == "filter-error":
        shape = replace(shape, window_s=max(shape.window_s, _FILTER_WINDOW_S))
    own = _expected_aerodynamics(apriori_envelope(aircraft, solved), nominal)
    if estimator == "filter-error":
        return shape, _filter(flight, aircraft, solved, own)
    return shape, _solver(estimator, solved, band_hz, None if own is None else own[1])


def flight_form(
    flight: FlightTable,
    aircraft: Aircraft,
    nominal: FlightCondition,
    form: Form,
    band_hz: tuple[float, float],
) -> FlightForm:
    """How a flight of an aircraft becomes manoeuvres; derivatives are referred to its nominal condition."""
    commanded = {u for u, name in SURFACE_OF_INPUT.items() if flight.kinds.get(f"{name}_rad") == "command"}
    servos = {u: getattr(aircraft.actuators, name) for u, name in SURFACE_OF_INPUT.items()}
    return FlightForm(
        (nominal.airspeed_true_m_s, nominal.air_density_kg_m3),
        frozenset(commanded),
        aircraft.sensors.imu_position_m,
        aircraft.sensors.vane_position_m,
        {u: 2.0 * math.pi * servo.bandwidth_hz for u, servo in servos.items() if servo is not None},
        form,
        max(_SHORTEST_WINDOW_S, _CYCLES / band_hz[0]),
        inertia_coupling(aircraft),
    )


def _solver(
    estimator: str,
    structure: ModeStructure,
    band_hz: tuple[float, float],
    natural: NDArray[np.float64] | None,
) -> Solve:
    if estimator == "output-error":
        return lambda parts: output_error(parts, natural=natural)
    if estimator == "equation-error":
        # phugoid and spiral leave the fast motion out, so it must not be in the data either
        cutoff_hz = band_hz[1] if {"theta", "phi"} & set(structure.equations) else None
        settings = EquationErrorConfig(cutoff_hz=cutoff_hz)
        return lambda parts: equation_error(parts, settings, natural=natural)
    config = FrequencyEquationErrorConfig(band_hz)
    return lambda parts: frequency_equation_error(parts, config, natural=natural)


def _filter(
    flight: FlightTable,
    aircraft: Aircraft,
    structure: ModeStructure,
    own: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
) -> Solve:
    """Filter error with the aircraft's wing span, vane, surface sensors and expected derivatives."""
    columns = [f"{SURFACE_OF_INPUT[u]}_rad" for u in structure.inputs if u in SURFACE_OF_INPUT]
    noise = [0.0 if flight.kinds.get(c) == "command" else aircraft.noise_std(c) for c in columns]
    known = tuple(n for n in noise if n is not None)
    config = FilterErrorConfig(
        vane_ahead_m=aircraft.sensors.vane_position_m[0],
        input_noise_std=known if len(known) == len(structure.inputs) else (),
    )
    if aircraft.geometry is not None:
        config = replace(config, span_m=aircraft.geometry.span_m)
    expected, natural = own if own is not None else (None, None)
    return lambda parts: filter_error(parts, config, expected=expected, natural=natural)


def _expected_aerodynamics(
    envelope: Envelope, nominal: FlightCondition
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Aerodynamic derivatives expected at cruise, and the natural size of each as the live chain takes it from them."""
    found = envelope.lookup(nominal)
    if isinstance(found, OutOfEnvelope):
        return None
    own = found.value - offsets(envelope.structure, nominal.airspeed_true_m_s, nominal.angle_of_attack_rad)
    return own, np.asarray(np.maximum(np.abs(own), 2.0 * found.standard_error))


def _expected(envelope: Envelope, estimate: Estimate) -> tuple[FlightCondition | None, Expectation | None]:
    airspeed, altitude, density, alpha = estimate.condition
    if not (math.isfinite(airspeed) and airspeed > 0.0 and math.isfinite(density)):
        return None, None
    angle = alpha if math.isfinite(alpha) else 0.0
    condition = FlightCondition(airspeed, altitude, density, angle_of_attack_rad=angle)
    found = envelope.lookup(condition)
    return condition, None if isinstance(found, OutOfEnvelope) else found


def _mode(aircraft: Aircraft, envelope: Envelope, estimate: Estimate, fit: Fit) -> dict[str, Any]:
    symbols = estimate.structure.derivatives
    condition, expected = _expected(envelope, estimate)
    values = dict(zip(symbols, estimate.value.tolist(), strict=True))
    quantities = mode_quantities(estimate.structure, values, estimate.covariance, condition, aircraft)
    mode = mode_object(estimate, expected, quantities)
    for k, symbol in enumerate(symbols):
        mode["derivatives"][symbol]["interval_95"] = fit.interval[k].tolist()
    modes = [
        {"mode": q.mode, "quantity": q.name, "value": q.value, "standard_error": q.standard_error, "unit": q.unit}
        for q in quantities
    ]  # fmt: skip
    return mode | {"modes": modes, "fit": _fit(symbols, estimate, fit)}


def _fit(symbols: Sequence[str], estimate: Estimate, fit: Fit) -> dict[str, Any]:
    def errors(covariance: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(symbols, np.sqrt(np.maximum(np.diagonal(covariance), 0.0)).tolist(), strict=True))

    return {
        "channels": {
            c.name: {
                "r_squared": c.r_squared,
                "tic": c.tic,
                "bias": c.bias,
                "variance": c.variance,
                "covariance": c.covariance,
                "residual_std": c.residual_std,
                "residual_autocorrelation": c.autocorrelation.tolist(),
            }
            for c in fit.channels
        },
        "correlation": {
            a: dict(zip(symbols, row, strict=True))
            for a, row in zip(symbols, fit.correlation.tolist(), strict=True)
        },
        "correlated_pairs": [
            {"derivatives": [a, b], "correlation": value}
            for a, b, value in correlated_pairs(estimate.structure, fit.correlation)
        ],
        "standard_error_white": errors(fit.covariance_white),
        "standard_error_coloured": errors(fit.covariance_coloured),
        "residuals_coloured": fit.coloured,
        "noise_std": dict(fit.noise_std),
        "samples": fit.samples,
        "manoeuvres": fit.manoeuvres,
        "parameters": fit.parameters,
        "iterations": fit.iterations,
        "converged": fit.converged,
    }
