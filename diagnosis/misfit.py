"""How far the simulation is from the flight, by channel."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.signal import detrend
from scipy.signal.windows import hann
from scipy.stats import chi2

from wingwatch.diagnosis.linear_model import STATES, Noise
from wingwatch.diagnosis.measured import FORCE_X, OUTPUTS
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, linear_at, model_at
from wingwatch.diagnosis.replay import TRIM_STEPS, Model, without_delays
from wingwatch.diagnosis.result import Misfit
from wingwatch.diagnosis.windows import open_loop

__all__ = ["Replayed", "misfit_of", "noise_variance", "of_open_loop", "replayed"]

Array = NDArray[np.float64]

_LAGS = 25
_BAND = 0.2
"""Part of the frequencies up to half the sample rate that counts in a coherence."""
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
    """Every window flown open loop through still air by the model of a point, from the start that follows it best.

    Starts and free trims of each window are fitted by least squares, outputs weighed by what sensor noise and gusts
    make of them.
    """
    model, weight = model_at(problem, point), noise_variance(problem, point) ** -0.5
    measured = without_delays(problem.subject.flight, model)
    windows = [measured[w.start : w.stop] for w in problem.windows]
    with ThreadPoolExecutor(WORKERS) as pool:
        simulated = pool.map(
            lambda w: _best(problem, point, w, model, windows[w], weight), range(len(windows))
        )
        return Replayed(windows, list(simulated))


_PASSES = 3
_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])


@np.errstate(all="ignore")  # a simulation that runs away is shown as it is
def _best(problem: Problem, point: Point, w: int, model: Model, rows: Array, weight: Array) -> Array:
    """A window open loop that follows its measured ``rows`` best, (samples, outputs) both."""
    used, free = list(problem.compared), list(problem.free_trims)
    measured = rows[:, used]
    seen, count = np.isfinite(measured), len(_STEPS)
    steps = np.concatenate([_STEPS, TRIM_STEPS[free]])
    place = np.concatenate([problem.starts[w], point.trims[w, free]])
    best, least = np.empty(0), np.inf
    for turn in range(_PASSES + 1):
        places = np.vstack([place, place + np.diag(steps)]) if turn < _PASSES else place[None]
        trims = np.tile(point.trims[w], (len(places), 1))
        trims[:, free] = places[:, count:]
        read = open_loop(problem, w, model, places[:, :count], trims, rows)
        off = ((measured - read[0][:, used]) * weight[used])[seen]
        cost = float(off @ off)
        if best.size and not cost < least:
            break
        best, least = read[0], cost
        if turn == _PASSES:
            break
        columns = ((read[1:] - read[0])[..., used] * weight[used])[:, seen].T / steps
        if not np.isfinite(columns).all():
            break
        place = place + np.linalg.lstsq(columns, off, rcond=1e-9)[0]
    return best


def noise_variance(problem: Problem, point: Point) -> Array:
    """Mean square of an open-loop residual that sensor noise and gusts make, of each output."""
    model = model_at(problem, point)
    total, readings = np.zeros(len(OUTPUTS)), 0
    for group in dict.fromkeys(problem.groups):
        linear = linear_at(problem, group, model, point.noise)
        process, spread = linear.covariances(of_open_loop(problem, point.noise))
        spread[:STATES, :STATES] = 0.0  # starts are fitted
        for _ in range(problem.windows[group].stop - problem.windows[group].start):
            total += np.einsum("ki,ij,kj->k", linear.output, spread, linear.output)
            spread = linear.transition @ spread @ linear.transition.T + process
            readings += 1
    return np.asarray(total / max(readings, 1) + point.noise.sensors**2)


def of_open_loop(problem: Problem, noise: Noise) -> Noise:
    """What disturbs a replay open loop: where the force along x is given, what its accelerometer reads wrongly.

    With the filter that force may be anything, for the file states none; open loop it is what was read.
    """
    if not problem.subject.given:
        return noise
    gusts = noise.gusts.copy()
    gusts[-1] = problem.subject.flight.noise_std[FORCE_X]
    return replace(noise, gusts=gusts, any_force_x=False)


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


_SEGMENT = 64


@np.errstate(all="ignore")  # a signal that does not move has no coherence
def _coherences(flown: Replayed, k: int) -> dict[str, float]:
    """Mean squared coherence of the residual with surfaces and states."""
    found: dict[str, list[float]] = {name: [] for name in _DRIVERS}
    for a, b in zip(flown.measured, flown.simulated, strict=True):
        drivers = {name: j for name, j in _DRIVERS.items() if j != k}
        rows = np.column_stack([a[:, k] - b[:, k], a[:, list(drivers.values())]])
        there = np.any(np.isfinite(rows), axis=0)
        rows = rows[:, there]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows) < 2 * _SEGMENT or not there[0]:
            continue
        names = [name for name, seen in zip(drivers, there[1:], strict=True) if seen]
        segments = sliding_window_view(rows, _SEGMENT, axis=0)[:: _SEGMENT // 2]
        lines = np.fft.rfft(detrend(segments, type="constant") * hann(_SEGMENT, sym=False))
        lines = lines[..., 1 : max(2, round(lines.shape[-1] * _BAND))]
        power, across = (np.abs(lines) ** 2).sum(axis=0), (lines[:, :1].conj() * lines[:, 1:]).sum(axis=0)
        value = np.abs(across) ** 2 / (power[:1] * power[1:])
        for name, row, moved in zip(names, value, np.ptp(rows[:, 1:], axis=0), strict=True):
            if moved > 0.0 and np.isfinite(row).any():
                found[name].append(float(row[np.isfinite(row)].mean()))
    return {name: float(np.mean(values)) for name, values in found.items() if values}
