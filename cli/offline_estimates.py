"""Estimates of a whole flight at once: equation error, in time or in frequency, and output error."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, ModeStructure
from wingwatch.baselines import OutOfEnvelope
from wingwatch.cli.faults import CommandError
from wingwatch.cli.flight_watch import OFFLINE
from wingwatch.cli.progress import Progress
from wingwatch.estimators import (
    Estimate,
    Fit,
    FrequencyEquationErrorConfig,
    Manoeuvre,
    ManoeuvreConfig,
    SignalConfig,
    Signals,
    correlated_pairs,
    equation_error,
    frequency_equation_error,
    manoeuvres,
    offsets,
    output_error,
)
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.chain import nominal_condition
from wingwatch.telemetry import FlightTable, SampleBlock

__all__ = ["OFFLINE_ESTIMATORS", "OfflineEstimates", "estimate_offline"]

OFFLINE_ESTIMATORS = ("equation-error", "frequency-equation-error", "output-error")

_INPUT_COLUMN = {"eta": "elevator_rad", "xi": "aileron_rad", "zeta": "rudder_rad"}

Solve = Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]


@dataclass(frozen=True, slots=True)
class OfflineEstimates:
    """What one estimator made of a flight.

    Attributes:
        monitor: not fed; knows what is expected and how samples were cleaned.
        flight: the flight.
        modes: estimate and fit by structure.
        absent: why a structure is not estimated.
        last_s: stamp of the last sample used.
    """

    monitor: VehicleMonitor
    flight: FlightTable
    modes: Mapping[str, tuple[Estimate, Fit]]
    absent: Mapping[str, str]
    last_s: float

    def document(self) -> dict[str, Any]:
        """The contract's objects of all modes, with the statistics of the fits."""
        return {name: _mode(self.monitor, *mode) for name, mode in self.modes.items()}


def estimate_offline(
    flight: FlightTable, aircraft: Aircraft, estimator: str, progress: Progress
) -> OfflineEstimates:
    """Every mode of a flight by one of ``OFFLINE_ESTIMATORS``.

    Raises:
        CommandError: no mode can be estimated.
    """
    numbers = iter(range(1, 1 + len(flight.block)))
    monitor = VehicleMonitor(
        aircraft,
        "default",
        OFFLINE,
        flight.block.present,
        flight.kinds,
        new_id=lambda: f"alert-{next(numbers)}",
    )
    absent = dict(monitor.chain.absent)
    clean = monitor.prepared(flight.block)
    modes: dict[str, tuple[Estimate, Fit]] = {}
    for structure in progress.track(list(monitor.chain.structures), "estimating"):
        parts = _parts(flight, aircraft, structure, clean)
        if not parts:
            absent[structure.name] = "there are not two seconds of whole samples in a row"
            continue
        try:
            modes[structure.name] = _solver(estimator, aircraft, monitor, structure)(parts)
        except ValueError as error:
            absent[structure.name] = str(error)
    if not modes:
        reasons = "; ".join(f"{name}: {why}" for name, why in absent.items())
        raise CommandError(f"{flight.source}: no mode can be estimated ({reasons})")
    return OfflineEstimates(monitor, flight, modes, absent, float(clean.time_s[-1]))


def _parts(
    flight: FlightTable, aircraft: Aircraft, structure: ModeStructure, clean: SampleBlock
) -> tuple[Manoeuvre, ...]:
    nominal = nominal_condition(aircraft)
    assert nominal is not None  # without one the chain has no structures
    reference = (nominal.airspeed_true_m_s, nominal.air_density_kg_m3)
    sensors = aircraft.sensors
    signals = Signals(
        SignalConfig(
            structure,
            sensors.vane_position_m,
            reference_airspeed_m_s=reference[0],
            reference_density_kg_m3=reference[1],
        )
    )
    held = tuple(flight.kinds.get(_INPUT_COLUMN[u], "position") == "command" for u in structure.inputs)
    config = ManoeuvreConfig(structure, reference, held, sensors.imu_position_m)
    return manoeuvres(config, signals.update(signals.init(1), clean.values[None])[0])


def _solver(estimator: str, aircraft: Aircraft, monitor: VehicleMonitor, structure: ModeStructure) -> Solve:
    natural = _natural(aircraft, monitor, structure)
    if estimator == "equation-error":
        return lambda parts: equation_error(parts, natural=natural)
    if estimator == "output-error":
        return lambda parts: output_error(parts, natural=natural)
    config = FrequencyEquationErrorConfig(aircraft.band_hz(structure))
    return lambda parts: frequency_equation_error(parts, config, natural=natural)


def _natural(
    aircraft: Aircraft, monitor: VehicleMonitor, structure: ModeStructure
) -> NDArray[np.float64] | None:
    """Natural size of each derivative as the live chain takes it from what is expected at cruise."""
    nominal = nominal_condition(aircraft)
    found = None if nominal is None else monitor.chain.envelopes[structure.name].lookup(nominal)
    if nominal is None or found is None or isinstance(found, OutOfEnvelope):
        return None
    own = found.value - offsets(structure, nominal.airspeed_true_m_s, nominal.angle_of_attack_rad)
    return np.asarray(np.maximum(np.abs(own), 2.0 * found.standard_error))


def _mode(monitor: VehicleMonitor, estimate: Estimate, fit: Fit) -> dict[str, Any]:
    symbols = estimate.structure.derivatives
    document = monitor.mode_object(estimate)
    for symbol, interval in zip(symbols, fit.interval.tolist(), strict=True):
        document["derivatives"][symbol]["interval_95"] = interval
    document["fit"] = {
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
        "standard_error_white": dict(
            zip(symbols, np.sqrt(np.diagonal(fit.covariance_white)).tolist(), strict=True)
        ),
        "standard_error_coloured": dict(
            zip(symbols, np.sqrt(np.diagonal(fit.covariance_coloured)).tolist(), strict=True)
        ),
        "residuals_coloured": fit.coloured,
        "noise_std": dict(fit.noise_std),
        "samples": fit.samples,
        "manoeuvres": fit.manoeuvres,
        "parameters": fit.parameters,
        "iterations": fit.iterations,
        "converged": fit.converged,
    }
    return document
