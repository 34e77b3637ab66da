"""Signals and spectra for pictures."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from wingwatch.diagnosis.linear_model import STATES, WIDTH
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.misfit import Replayed, of_open_loop
from wingwatch.diagnosis.problem import Point, Problem, linear_at, model_at
from wingwatch.diagnosis.result import Traces

__all__ = ["traces_of"]

Array = NDArray[np.float64]

_SEGMENT = 128
_DRAWS, _SEED = 32, 20240502
"""Of the noise's spectra."""


def traces_of(problem: Problem, before: Replayed, after: Replayed, point: Point) -> Traces:
    """Of all windows one after another, a row without values between them; ``point``: whose noise no model explains."""
    flight = problem.subject.flight
    gap = np.full(1, np.nan)
    time_s = np.concatenate([np.concatenate([flight.time_s[w.start : w.stop], gap]) for w in problem.windows])

    def joined(windows: list[Array], k: int) -> Array:
        return np.concatenate([np.concatenate([window[:, k], gap]) for window in windows])

    names = [OUTPUTS[k] for k in problem.compared]
    hz = np.asarray(np.fft.rfftfreq(_SEGMENT, flight.dt_s), dtype=np.float64)
    spectra = {}
    floors = _noise_spectra(problem, point)
    for k in problem.compared:
        spectra[OUTPUTS[k]] = np.vstack(
            [_spectrum(before, k, flight.dt_s), _spectrum(after, k, flight.dt_s), floors[k]]
        )
    return Traces(
        time_s,
        {name: joined(before.measured, k) for name, k in zip(names, problem.compared, strict=True)},
        {name: joined(before.simulated, k) for name, k in zip(names, problem.compared, strict=True)},
        {name: joined(after.simulated, k) for name, k in zip(names, problem.compared, strict=True)},
        hz,
        spectra,
    )


def _spectrum(flown: Replayed, k: int, dt_s: float) -> Array:
    """Mean power spectral density of a residual over the windows."""
    found = [welch(a - b, 1.0 / dt_s, nperseg=_SEGMENT)[1] for a, b in flown.pairs(k) if len(a) >= _SEGMENT]
    return np.mean(found, axis=0) if found else np.full(_SEGMENT // 2 + 1, np.nan)


def _noise_spectra(problem: Problem, point: Point) -> Array:
    """Of what sensor noise and gusts make of an open-loop residual, (outputs, bins): draws of equation (1)."""
    rng, dt_s = np.random.default_rng(_SEED), problem.subject.flight.dt_s
    model, noise = model_at(problem, point), of_open_loop(problem, point.noise)
    total, windows = np.zeros((len(OUTPUTS), _SEGMENT // 2 + 1)), 0
    for group in dict.fromkeys(problem.groups):
        linear = linear_at(problem, group, model, point.noise)
        process, start = linear.covariances(noise)
        start[:STATES, :] = start[:, :STATES] = 0.0  # starts are fitted
        samples = problem.windows[group].stop - problem.windows[group].start
        driven, x = _root(process), rng.standard_normal((_DRAWS, WIDTH)) @ _root(start).T
        read = np.empty((samples, _DRAWS, len(OUTPUTS)))
        for t in range(samples):
            read[t] = x @ linear.output.T
            x = x @ linear.transition.T + rng.standard_normal((_DRAWS, WIDTH)) @ driven.T
        if samples >= _SEGMENT:
            count = problem.groups.count(group)
            total += count * welch(read, 1.0 / dt_s, nperseg=_SEGMENT, axis=0)[1].mean(axis=1).T
            windows += count
    return np.asarray(total / max(windows, 1) + 2.0 * dt_s * noise.sensors[:, None] ** 2)


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is a covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
