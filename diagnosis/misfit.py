"""How far the simulation is from the flight, by channel."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import coherence
from scipy.stats import chi2

from wingwatch.diagnosis.innovations import air_response
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.problem import Point, Problem, model_at
from wingwatch.diagnosis.replay import without_delays
from wingwatch.diagnosis.result import Misfit
from wingwatch.diagnosis.windows import filter_of, simulate

__all__ = ["Replayed", "misfit_of", "noise_variance", "replayed"]

Array = NDArray[np.float64]

_LAGS = 25
_BAND_HZ = 5.0
_DRIVERS: Mapping[str, int] = {
    "elevator": 11, "aileron": 12, "rudder": 13, "roll rate": 1, "pitch rate": 2, "yaw rate": 3,
    "angle of attack": 9, "sideslip": 10,
}  # fmt: skip


class Replayed:
    """Measured and simulated outputs of every window, (samples, outputs) each, through still air."""

    def __init__(self, measured: list[Array], simulated: list[Array]) -> None:
        self.measured, self.simulated = measured, simulated

    def extend(self, other: "Replayed") -> None:
        """Further windows."""
        self.measured.extend(other.measured)
        self.simulated.extend(other.simulated)

    def pairs(self, k: int, windows: list[int] | None = None) -> list[tuple[Array, Array]]:
        """Of one output, where it was measured."""
        chosen = range(len(self.measured)) if windows is None else windows
        out = []
        for w in chosen:
            there = np.isfinite(self.measured[w][:, k])
            if there.sum() >= 3:
                out.append((self.measured[w][there, k], self.simulated[w][there, k]))
        return out


def replayed(problem: Problem, point: Point) -> Replayed:
    """Every window flown by the model of a point; what the estimated air does is left out."""
    model = model_at(problem, point)
    measured = without_delays(problem.subject.flight, model)
    windows, simulated = [], []
    for w, window in enumerate(problem.windows):
        linear, _ = filter_of(problem, point, problem.groups[w], model)
        read = simulate(problem, point, w, [model], linear)[0] - air_response(linear, point.air[w])
        windows.append(measured[window.start : window.stop])
        simulated.append(read)
    return Replayed(windows, simulated)


def noise_variance(problem: Problem, point: Point) -> Array:
    """Mean square of an open-loop residual that sensor noise and gusts make, of each output."""
    model = model_at(problem, point)
    total, readings = np.zeros(len(OUTPUTS)), 0
    for group in dict.fromkeys(problem.groups):
        linear, _ = filter_of(problem, point, group, model)
        process, spread = linear.covariances(point.noise)
        for _ in range(problem.windows[group].stop - problem.windows[group].start):
            total += np.einsum("ki,ij,kj->k", linear.output, spread, linear.output)
            spread = linear.transition @ spread @ linear.transition.T + process
            readings += 1
    return np.asarray(total / max(readings, 1) + point.noise.sensors**2)


def misfit_of(flown: Replayed, k: int, noise: float, windows: list[int] | None = None) -> Misfit | None:
    """Figures of one output; None where it was not measured or never moved."""
    pairs = flown.pairs(k, windows)
    if not pairs:
        return None
    y = np.concatenate([a - a.mean() for a, _ in pairs])
    e = np.concatenate([a - b for a, b in pairs])
    z = np.concatenate([b - a.mean() for a, b in pairs])
    square, moved = float(np.mean(e**2)), float(np.mean(y**2))
    if moved == 0.0 or square == 0.0:
        return None
    means = float(np.mean([(a.mean() - b.mean()) ** 2 for a, b in pairs]))
    deviations = float(np.mean([(a.std() - b.std()) ** 2 for a, b in pairs]))
    bias, variance = min(means / square, 1.0), min(deviations / square, 1.0)
    return Misfit(
        r_squared=1.0 - square / moved,
        tic=np.sqrt(square) / (np.sqrt(moved) + float(np.sqrt(np.mean(z**2)))),
        bias=bias,
        variance=variance,
        covariance=max(0.0, 1.0 - bias - variance),
        noise_fraction=min(1.0, noise / square),
        whiteness=_whiteness([a - b for a, b in pairs]),
        coherence=_coherences(flown, k),
    )


def _whiteness(residuals: list[Array]) -> float:
    """Probability by Ljung and Box that white noise is so correlated."""
    square = sum(float(e @ e) for e in residuals)
    n = sum(len(e) for e in residuals)
    q = 0.0
    for lag in range(1, _LAGS + 1):
        r = sum(float(e[lag:] @ e[:-lag]) for e in residuals if len(e) > lag) / square
        q += r * r / (n - lag)
    return float(chi2.sf(n * (n + 2) * q, _LAGS))


@np.errstate(all="ignore")  # a signal that does not move has no coherence
def _coherences(flown: Replayed, k: int) -> dict[str, float]:
    """Mean squared coherence below 5 Hz of the residual with surfaces and states."""
    out = {}
    for name, j in _DRIVERS.items():
        parts = []
        for a, b in zip(flown.measured, flown.simulated, strict=True):
            there = np.isfinite(a[:, k]) & np.isfinite(a[:, j])
            if there.sum() >= 128 and np.ptp(a[there, j]) > 0.0 and j != k:
                hz, value = coherence(a[there, k] - b[there, k], a[there, j], nperseg=64)
                seen = value[1 : max(2, round(len(hz) * 0.2))]
                parts += [float(seen[np.isfinite(seen)].mean())] if np.isfinite(seen).any() else []
        if parts:
            out[name] = float(np.mean(parts))
    return out
