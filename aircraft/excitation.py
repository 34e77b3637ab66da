"""Shapes of excitation inputs (thesis 4.2.3): widths that suit a mode, laws of sweeps, phases of multisines.

Pure mathematics that whoever flies an input and whoever designs one share.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.linearisation import linearised_derivatives
from wingwatch.aircraft.modes import natural_frequency_and_damping, state_matrix
from wingwatch.aircraft.structures import ModeStructure

__all__ = [
    "SweepKind",
    "deal_harmonics",
    "doublet_pulse_s",
    "low_peak_phases_rad",
    "mode_frequency_rad_s",
    "relative_peak_factor",
    "sample_wave",
    "schroeder_phases_rad",
    "step_3211_modified_s",
    "step_3211_s",
    "sweep_end_s",
    "sweep_phase_rad",
    "sweep_rate",
    "wave",
]

SweepKind = Literal["linear", "logarithmic"]

_SAMPLES_A_CYCLE = 16
"""Of the fastest harmonic: the peak between samples is then at most 1 / cos(pi / 16) = 2 % higher."""
_NORMS = (4, 8, 16, 32, 64)
_MOST_ITERATIONS = 100
"""A norm; ten times as many have not been seen to lower the peak by another 0.3 %."""


def mode_frequency_rad_s(aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure) -> float:
    """Natural frequency of a mode, for the width of an excitation.

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
        ValueError: a mode without natural frequency there.
    """
    matrix = state_matrix(structure, linearised_derivatives(aircraft, condition, structure))
    frequency, _ = natural_frequency_and_damping(structure, matrix)
    if math.isnan(frequency):
        raise ValueError(
            f"{structure.name} of {aircraft.name} has no natural frequency at {condition.airspeed_true_m_s:g} m/s; "
            "give widths and bands of excitations by hand"
        )
    return frequency


def doublet_pulse_s(natural_frequency_rad_s: float) -> float:
    """Width of one pulse of a doublet that excites a mode: 2.3 / omega_n (thesis equation 4.2)."""
    return 2.3 / natural_frequency_rad_s


def step_3211_s(natural_frequency_rad_s: float) -> float:
    """Width of the single step of a 3-2-1-1 with the mode amid its spectrum: 1.6 / omega_n (thesis equation 4.3a)."""
    return 1.6 / natural_frequency_rad_s


def step_3211_modified_s(natural_frequency_rad_s: float) -> float:
    """The same with the mode in the upper third of its spectrum: 2.1 / omega_n (thesis equation 4.3b)."""
    return 2.1 / natural_frequency_rad_s


def sweep_rate(kind: SweepKind, band_hz: tuple[float, float], length_s: float) -> float:
    """How fast a sweep's angular frequency grows: rad/s2 if linear, 1/s (of its logarithm) if logarithmic."""
    first, last = band_hz
    if kind == "linear":
        return 2.0 * math.pi * (last - first) / length_s
    return math.log(last / first) / length_s


def sweep_phase_rad(
    kind: SweepKind, band_hz: tuple[float, float], length_s: float, since_s: ArrayLike
) -> NDArray[np.float64]:
    """Phase of a sweep at times since its start, shape of ``since_s``.

    Linear: omega = omega_1 + (omega_2 - omega_1) t / T (thesis equation 4.4b). Logarithmic: omega = omega_1 (omega_2 /
    omega_1)^(t / T), which spends the same time in every octave (the thesis's equation 4.4c nears this by constants).
    """
    t, omega = np.asarray(since_s, dtype=np.float64), 2.0 * math.pi * band_hz[0]
    rate = sweep_rate(kind, band_hz, length_s)
    if kind == "linear":
        return np.asarray((omega + 0.5 * rate * t) * t)
    return np.asarray(omega * np.expm1(rate * t) / rate)


def sweep_end_s(kind: SweepKind, band_hz: tuple[float, float], length_s: float) -> float:
    """Time from a sweep's start to its last crossing of zero within its length."""
    omega, rate = 2.0 * math.pi * band_hz[0], sweep_rate(kind, band_hz, length_s)
    phase = math.pi * math.floor(float(sweep_phase_rad(kind, band_hz, length_s, length_s)) / math.pi + 1e-9)
    if kind == "linear":  # the root nearer to the start, without cancellation
        return 2.0 * phase / (omega + math.sqrt(max(0.0, omega * omega + 2.0 * rate * phase)))
    return math.log1p(phase * rate / omega) / rate


def deal_harmonics(
    names: Sequence[str], bands_hz: Sequence[tuple[float, float]], length_s: float
) -> tuple[tuple[int, ...], ...]:
    """Multiples of 1 / length_s within each surface's band, dealt out in turn, so that no two share one.

    Raises:
        ValueError: a band without a harmonic for some surface.
    """
    dealt = []
    for i, (name, (low, high)) in enumerate(zip(names, bands_hz, strict=True)):
        first, last = max(1, math.ceil(low * length_s - 1e-9)), math.floor(high * length_s + 1e-9)
        ks = tuple(k for k in range(first, last + 1) if (k - 1) % len(names) == i)
        if not ks:
            raise ValueError(
                f"a multisine of {length_s:g} s has no harmonic for {name} from {low:g} to {high:g} Hz; "
                "make it longer or the band wider"
            )
        dealt.append(ks)
    return tuple(dealt)


def _sizes(harmonics: Sequence[int], amplitudes: ArrayLike | None) -> NDArray[np.float64]:
    return np.ones(len(harmonics)) if amplitudes is None else np.asarray(amplitudes, dtype=np.float64)


def wave(
    harmonics: Sequence[int], phases_rad: ArrayLike, samples: int, amplitudes: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Sum of a sin(2 pi k t / T + phase) over a period T at evenly spaced instants, shape (samples,).

    ``amplitudes`` are one a harmonic, all 1 where not given.
    """
    turn = 2.0 * np.pi * np.arange(samples) / samples
    angles = np.multiply.outer(turn, np.asarray(harmonics)) + np.asarray(phases_rad, dtype=np.float64)
    return np.asarray(np.sin(angles) @ _sizes(harmonics, amplitudes))


def sample_wave(
    harmonics: Sequence[int], phases_rad: ArrayLike, amplitudes: ArrayLike | None = None
) -> NDArray[np.float64]:
    """The same at 16 instants a cycle of the fastest: its peak between them is at most 2 % higher."""
    return wave(harmonics, phases_rad, _SAMPLES_A_CYCLE * max(harmonics), amplitudes)


def relative_peak_factor(
    harmonics: Sequence[int], phases_rad: ArrayLike, amplitudes: ArrayLike | None = None
) -> float:
    """(largest - smallest) / (2 sqrt(2) rms) of a sum of sines: 1 for one sine, lower is better (Klein and
    Morelli, equation 9.26 ff)."""
    x = sample_wave(harmonics, phases_rad, amplitudes)
    square = 0.5 * float(np.sum(_sizes(harmonics, amplitudes) ** 2))
    return float((x.max() - x.min()) / (2.0 * math.sqrt(2.0) * math.sqrt(square)))


def schroeder_phases_rad(n: int, amplitudes: ArrayLike | None = None) -> NDArray[np.float64]:
    """Phases of n sines whose sum has a flat envelope: phi_k = -2 pi sum over j < k of (k - j) p_j, p_j the shares of
    power (Schroeder 1970, equation 11); for equal ones -pi k (k - 1) / n, k = 1 ... n."""
    power = _sizes(range(n), amplitudes) ** 2
    below = np.concatenate([[0.0], np.cumsum(np.cumsum(power))[:-1]])
    return np.asarray(-2.0 * np.pi * below / power.sum())


def low_peak_phases_rad(harmonics: Sequence[int], amplitudes: ArrayLike | None = None) -> NDArray[np.float64]:
    """Phases that make the peak low for the power, and the sum start, and so end, at zero.

    Schroeder's (IEEE Transactions on Information Theory 16, 1970, pages 85-89), then improved by minimising ever higher
    norms of the signal (Guillaume, Schoukens, Pintelon and Kollar, IEEE Transactions on Instrumentation and Measurement
    40, 1991, pages 982-989), then shifted in time.

    Args:
        harmonics: ascending whole numbers, shape (n,).
        amplitudes: of each, shape (n,), equal where not given; positive.
    """
    samples, ks, sizes = (
        _SAMPLES_A_CYCLE * max(harmonics),
        np.asarray(harmonics),
        _sizes(harmonics, amplitudes),
    )
    turn = np.multiply.outer(2.0 * np.pi * np.arange(samples) / samples, ks)

    def logarithm_of_norm(phases: NDArray[np.float64], p: int) -> tuple[float, NDArray[np.float64]]:
        angles = turn + phases
        x = np.sin(angles) @ sizes
        top = np.abs(x).max()
        powers = (x / top) ** (p - 1)
        total = float((powers * x).sum() / top)
        return math.log(top) + math.log(total) / p, (powers @ np.cos(angles)) * sizes / (top * total)

    phases = best = schroeder_phases_rad(len(harmonics), sizes)
    for p in _NORMS:
        found = scipy.optimize.minimize(
            logarithm_of_norm,
            phases,
            args=(p,),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": _MOST_ITERATIONS},
        )
        phases = np.asarray(found.x)
        if relative_peak_factor(harmonics, phases, sizes) < relative_peak_factor(harmonics, best, sizes):
            best = phases
    return _from_zero(ks, best, sizes)


def _from_zero(
    ks: NDArray[np.int_], phases: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The same wave from a crossing of zero on: phases + k tau."""
    x = sample_wave(ks.tolist(), phases, sizes)
    i = int(np.argmax(np.diff(np.signbit(x))))
    low, high = (2.0 * np.pi * j / len(x) for j in (i, i + 1))
    rising = sizes @ np.sin(ks * low + phases) < 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if (sizes @ np.sin(ks * middle + phases) < 0.0) == rising:
            low = middle
        else:
            high = middle
    shifted = phases + ks * 0.5 * (low + high)
    return np.asarray(np.remainder(shifted + np.pi, 2.0 * np.pi) - np.pi)
