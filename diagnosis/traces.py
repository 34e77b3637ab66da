"""Signals and spectra for pictures."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.misfit import Replayed
from wingwatch.diagnosis.problem import Problem
from wingwatch.diagnosis.result import Traces

__all__ = ["traces_of"]

Array = NDArray[np.float64]

_SEGMENT = 128


def traces_of(problem: Problem, before: Replayed, after: Replayed, noise: Array) -> Traces:
    """Of all windows one after another, a row without values between them."""
    flight = problem.subject.flight
    gap = np.full(1, np.nan)
    time_s = np.concatenate([np.concatenate([flight.time_s[w.start : w.stop], gap]) for w in problem.windows])

    def joined(windows: list[Array], k: int) -> Array:
        return np.concatenate([np.concatenate([window[:, k], gap]) for window in windows])

    names = [OUTPUTS[k] for k in problem.compared]
    hz = np.asarray(np.fft.rfftfreq(_SEGMENT, flight.dt_s), dtype=np.float64)
    spectra = {}
    for k in problem.compared:
        floor = np.full(hz.size, 2.0 * flight.dt_s * float(noise[k]))
        spectra[OUTPUTS[k]] = np.vstack(
            [_spectrum(before, k, flight.dt_s), _spectrum(after, k, flight.dt_s), floor]
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
