"""Excitation inputs designed for a mode (thesis 4.2.3), on one surface or several, and what they contain.

An input is a deflection from trim at evenly spaced samples, held from each to the next. Shapes and widths are those of
``wingwatch.aircraft.excitation``; what an input promises is in ``excitation_promise``.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import SURFACE_OF_INPUT
from wingwatch.aircraft.excitation import (
    SweepKind,
    deal_harmonics,
    doublet_pulse_s,
    low_peak_phases_rad,
    sample_wave,
    step_3211_modified_s,
    step_3211_s,
    sweep_end_s,
    sweep_phase_rad,
    wave,
)
from wingwatch.aircraft.modes import natural_frequency_and_damping, state_matrix
from wingwatch.aircraft.structures import SPIRAL, ModeStructure

__all__ = [
    "INPUT_KINDS",
    "InputDesign",
    "SPIRAL_BANK_RAD",
    "SurfaceTarget",
    "design_input",
    "surface_targets",
]

Array = NDArray[np.float64]

_MOST_SAMPLES = 100_000

SPIRAL_BANK_RAD = math.radians(10.0)
"""To which a step banks for the spiral: sin(bank) is bank to 0.5 %, and the load factor one to 1.5 %."""


@dataclass(frozen=True, slots=True)
class SurfaceTarget:
    """A surface, and the mode that it is to excite.

    Attributes:
        surface: elevator, aileron or rudder.
        amplitude_rad: largest deflection from trim.
        natural_frequency_rad_s: of the mode, for the widths of steps; of one that does not oscillate 1 / time constant.
        band_hz: lowest and highest frequency of interest, for sweeps and multisines.
        poles: roots of the mode, 1/s, for a spectrum weighted towards it.
        longest_step_s: what a step may last at this amplitude; of the spiral until ``SPIRAL_BANK_RAD`` is reached.

    Raises:
        ValueError: an amplitude of pi/2 or more or not above 0, no frequency, a band that does not ascend from above 0.
    """

    surface: str
    amplitude_rad: float
    natural_frequency_rad_s: float
    band_hz: tuple[float, float]
    poles: tuple[complex, ...] = ()
    longest_step_s: float = math.inf

    def __post_init__(self) -> None:
        if not 0.0 < self.amplitude_rad < math.pi / 2.0:
            raise ValueError(
                f"the {self.surface} has amplitude {math.degrees(self.amplitude_rad):g} degrees; "
                "give more than 0 and less than 90"
            )
        if not (math.isfinite(self.natural_frequency_rad_s) and self.natural_frequency_rad_s > 0.0):
            raise ValueError(
                f"the mode of the {self.surface} has natural frequency {self.natural_frequency_rad_s} rad/s, so no "
                "width can be fitted to it; choose a condition where it oscillates"
            )
        low, high = self.band_hz
        if not 0.0 < low < high < math.inf:
            raise ValueError(
                f"the {self.surface} has band {low:g} to {high:g} Hz; give an ascending one above 0"
            )


def surface_targets(
    structure: ModeStructure,
    derivatives: Mapping[str, float],
    band_hz: tuple[float, float],
    amplitude_rad: float,
) -> tuple[SurfaceTarget, ...]:
    """The surfaces of a mode, each to excite it.

    The time constant takes the place of 1 / omega_n in a mode of one real root: a first-order motion answers half of
    its power at omega = 1 / T.

    Args:
        structure: the mode.
        derivatives: concise, by symbol.
        band_hz: of the mode (``Aircraft.band_hz``).
        amplitude_rad: largest deflection of each.

    Raises:
        ValueError: as ``SurfaceTarget``; so a mode without natural frequency.
    """
    matrix = state_matrix(structure, derivatives)
    frequency, _ = natural_frequency_and_damping(structure, matrix)
    poles = tuple(complex(root) for root in np.linalg.eigvals(matrix))
    if not structure.oscillations:
        frequency = max(abs(pole) for pole in poles)
    longest = math.inf
    if structure == SPIRAL:
        longest = SPIRAL_BANK_RAD / max(abs(derivatives["phi_zeta"]) * amplitude_rad, 1e-9)
    return tuple(
        SurfaceTarget(SURFACE_OF_INPUT[u], amplitude_rad, frequency, band_hz, poles, longest)
        for u in structure.inputs
    )


@dataclass(frozen=True, slots=True)
class InputDesign:
    """An input as it is flown.

    Attributes:
        kind: a key of ``INPUT_KINDS``.
        targets: one a surface.
        rate_hz: samples a second.
        inputs_rad: deflections from trim, shape (samples, surfaces), held from each sample to the next.
        widths_s: of the narrowest step of each surface as flown, in whole samples; 0 for sines.
        harmonics: of each surface's multisine, multiples of 1 / length_s; empty for other kinds.
    """

    kind: str
    targets: tuple[SurfaceTarget, ...]
    rate_hz: float
    inputs_rad: Array
    widths_s: tuple[float, ...]
    harmonics: tuple[tuple[int, ...], ...] = field(default=())

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Names, in the order of the columns."""
        return tuple(t.surface for t in self.targets)

    @property
    def length_s(self) -> float:
        """Samples over their rate."""
        return len(self.inputs_rad) / self.rate_hz

    @property
    def time_s(self) -> Array:
        """Of the samples, shape (samples,), from 0."""
        return np.arange(len(self.inputs_rad)) / self.rate_hz

    @property
    def energy_rad2_s(self) -> Array:
        """Integral of the square, shape (surfaces,)."""
        return np.asarray(np.sum(self.inputs_rad**2, axis=0) / self.rate_hz)

    @property
    def relative_peak_factors(self) -> Array:
        """(largest - smallest) / (2 sqrt(2) rms) while the surface is out of trim, a ratio, shape (surfaces,).

        1 for a sine, 0.71 for steps up and down (Klein and Morelli, equation 9.26 ff).
        """
        factors = []
        for u in self.inputs_rad.T:
            moved = np.flatnonzero(u)
            acting = u[moved[0] : moved[-1] + 1]
            factors.append(np.ptp(acting) / (2.0 * math.sqrt(2.0) * math.sqrt(np.mean(acting**2))))
        return np.array(factors)

    @property
    def rates_rad_s(self) -> Array:
        """Largest change from one sample to the next over its time, shape (surfaces,)."""
        return np.asarray(np.abs(np.diff(self.inputs_rad, axis=0)).max(axis=0) * self.rate_hz)

    def spectrum(self) -> tuple[Array, Array]:
        """One-sided power spectral density of the samples.

        Returns:
            frequencies in Hz, multiples of 1 / length_s, shape (f,); density in rad2/Hz, shape (f, surfaces), whose sum
            over frequencies times 1 / length_s is the mean square (Parseval).
        """
        n = len(self.inputs_rad)
        lines = np.fft.rfft(self.inputs_rad, axis=0)
        density = 2.0 * np.abs(lines) ** 2 / (n * self.rate_hz)
        density[0] /= 2.0
        if n % 2 == 0:
            density[-1] /= 2.0
        return np.asarray(np.fft.rfftfreq(n, 1.0 / self.rate_hz), dtype=np.float64), density

    def share_in_band(self) -> Array:
        """Power within each surface's band over all of it, shape (surfaces,)."""
        frequency, density = self.spectrum()
        shares = []
        for target, column in zip(self.targets, density.T, strict=True):
            inside = (frequency >= target.band_hz[0] - 1e-9) & (frequency <= target.band_hz[1] + 1e-9)
            shares.append(column[inside].sum() / column.sum())
        return np.array(shares)


@dataclass(frozen=True, slots=True)
class _Steps:
    """Steps one after another: lengths in units, deflections over the amplitude, and the unit's width for a mode."""

    units: tuple[int, ...]
    levels: tuple[float, ...]
    width_s: Callable[[SurfaceTarget], float]


def _impulse_s(target: SurfaceTarget) -> float:
    """A pulse of width T has the spectrum sin(x) / x, x = omega T / 2, which is down by 1 dB at x = 0.82: flat in the
    band."""
    return 1.64 / (2.0 * math.pi * target.band_hz[1])


def _step_s(target: SurfaceTarget) -> float:
    """The same spectrum at half of its power, x = 1.39, where the mode is: a step's power lies below."""
    return min(2.78 / target.natural_frequency_rad_s, target.longest_step_s)


def _of_mode(width_s: Callable[[float], float]) -> Callable[[SurfaceTarget], float]:
    return lambda target: width_s(target.natural_frequency_rad_s)


_STEPS: Mapping[str, _Steps] = {
    "impulse": _Steps((1,), (1.0,), _impulse_s),
    "step": _Steps((1,), (1.0,), _step_s),
    "doublet": _Steps((1, 1), (1.0, -1.0), _of_mode(doublet_pulse_s)),
    "3211": _Steps((3, 2, 1, 1), (1.0, -1.0, 1.0, -1.0), _of_mode(step_3211_s)),
    # with two thirds in the first step the steps add up to nothing, so the trim is kept
    "3211-modified": _Steps((3, 2, 1, 1), (2.0 / 3.0, -1.0, 1.0, -1.0), _of_mode(step_3211_modified_s)),
    "1123": _Steps((1, 1, 2, 3), (1.0, -1.0, 1.0, -1.0), _of_mode(step_3211_s)),
    "211": _Steps((2, 1, 1), (1.0, -1.0, 1.0), _of_mode(step_3211_s)),
}
_SWEEPS: Mapping[str, SweepKind] = {"sweep": "linear", "logarithmic-sweep": "logarithmic"}
_MULTISINES = ("multisine", "weighted-multisine")

INPUT_KINDS: Mapping[str, str] = {
    "impulse": "a pulse so short that its spectrum is flat within 1 dB in the band",
    "step": "a pulse whose spectrum has half of its power at the mode and the most below",
    "doublet": "a pulse up and a pulse down, 2.3 / omega_n each (thesis equation 4.2)",
    "3211": "steps of 3, 2, 1 and 1 units of 1.6 / omega_n (4.3a)",
    "3211-modified": "the same with 2.1 / omega_n (4.3b) and two thirds in the first step, so that the trim is kept",
    "1123": "the 3-2-1-1 backwards",
    "211": "the 3-2-1-1 without its first step, the other way up",
    "sweep": "a sine of linearly rising frequency through the band (4.4b)",
    "logarithmic-sweep": "a sine that spends the same time in every octave of the band (4.4c)",
    "multisine": "a sum of equal sines with phases of a low peak, harmonics dealt out to the surfaces",
    "weighted-multisine": "the same with the sines as strong as the mode answers to them",
}
"""Every kind of input with one line on what it is."""


def design_input(
    kind: str,
    targets: Sequence[SurfaceTarget],
    length_s: float,
    rate_hz: float = 50.0,
) -> InputDesign:
    """An input of a kind that suits the modes of its surfaces.

    Steps and sweeps move one surface after another, each in an equal share of the length: the rest of its share is free
    response. Multisines move all at once over the whole length, orthogonally, since no two share a harmonic. Steps take
    effect in whole samples.

    Args:
        kind: a key of ``INPUT_KINDS``.
        targets: surfaces, each once.
        length_s: of the whole record, taken to the nearest sample.
        rate_hz: samples a second.

    Raises:
        ValueError: an unknown kind, no or repeated surfaces, a length or rate that does not serve, an input that
            does not fit.
    """
    _check(kind, targets, length_s, rate_hz)
    samples = round(length_s * rate_hz)
    inputs, widths = np.zeros((samples, len(targets))), [0.0] * len(targets)
    if kind in _MULTISINES:
        inputs, harmonics = _multisines(targets, samples, rate_hz, kind == "weighted-multisine")
        return InputDesign(kind, tuple(targets), rate_hz, inputs, tuple(widths), harmonics)
    room = samples // len(targets)
    for i, target in enumerate(targets):
        if kind in _STEPS:
            shape, widths[i] = _stepped(kind, target, room, rate_hz)
        else:
            shape = _swept(_SWEEPS[kind], target, room, rate_hz)
        inputs[i * room : i * room + len(shape), i] = shape
    return InputDesign(kind, tuple(targets), rate_hz, inputs, tuple(widths))


def _check(kind: str, targets: Sequence[SurfaceTarget], length_s: float, rate_hz: float) -> None:
    if kind not in INPUT_KINDS:
        raise ValueError(f"no input is of kind {kind!r}; give one of {', '.join(INPUT_KINDS)}")
    names = [t.surface for t in targets]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"an input moves {', '.join(names) or 'no surface'}; give each surface once")
    if not 1.0 <= rate_hz <= 1000.0:
        raise ValueError(f"a rate of {rate_hz:g} Hz; give 1 to 1000 samples a second")
    if not (math.isfinite(length_s) and 2.0 <= round(length_s * rate_hz) <= _MOST_SAMPLES):
        raise ValueError(
            f"a length of {length_s:g} s at {rate_hz:g} Hz; give 2 to {_MOST_SAMPLES} samples of record"
        )
    for t in targets:
        if kind not in _STEPS and 2.0 * t.band_hz[1] >= rate_hz:
            raise ValueError(
                f"the {t.surface} has a band up to {t.band_hz[1]:g} Hz, too fast for {rate_hz:g} samples a second; "
                "raise the rate"
            )


def _stepped(kind: str, target: SurfaceTarget, room: int, rate_hz: float) -> tuple[Array, float]:
    """Deflections, shape (n,), n at most ``room``, and the width of one unit as flown, s."""
    steps = _STEPS[kind]
    wanted_s = steps.width_s(target)
    unit = round(wanted_s * rate_hz)
    if unit < 1:
        raise ValueError(
            f"a {kind} on the {target.surface} has steps of {wanted_s:.3g} s, shorter than half a sample at "
            f"{rate_hz:g} Hz; give a rate of at least {math.ceil(1.0 / wanted_s):d} Hz"
        )
    shape = target.amplitude_rad * np.repeat(steps.levels, [unit * n for n in steps.units])
    if len(shape) > room:
        raise ValueError(
            f"a {kind} on the {target.surface} takes {len(shape) / rate_hz:.3g} s, more than its "
            f"{room / rate_hz:.3g} s of the record; make it longer"
        )
    return shape, unit / rate_hz


def _swept(law: SweepKind, target: SurfaceTarget, room: int, rate_hz: float) -> Array:
    """Deflections, shape (n,), n at most ``room``; it ends at a crossing of zero."""
    length_s = room / rate_hz
    if float(sweep_phase_rad(law, target.band_hz, length_s, length_s)) < 2.0 * math.pi:
        raise ValueError(
            f"a sweep on the {target.surface} from {target.band_hz[0]:g} to {target.band_hz[1]:g} Hz has "
            f"{length_s:.3g} s, less than a whole cycle; make the record longer"
        )
    n = min(room, math.ceil(sweep_end_s(law, target.band_hz, length_s) * rate_hz - 1e-9))
    phase = sweep_phase_rad(law, target.band_hz, length_s, np.arange(n) / rate_hz)
    return np.asarray(target.amplitude_rad * np.sin(phase))


def _multisines(
    targets: Sequence[SurfaceTarget], samples: int, rate_hz: float, weighted: bool
) -> tuple[Array, tuple[tuple[int, ...], ...]]:
    """Deflections (samples, surfaces), and each surface's harmonics."""
    length_s = samples / rate_hz
    dealt = deal_harmonics([t.surface for t in targets], [t.band_hz for t in targets], length_s)
    columns = []
    for target, ks in zip(targets, dealt, strict=True):
        sizes = _gain(target, np.array(ks) / length_s) if weighted else np.ones(len(ks))
        phases = low_peak_phases_rad(ks, sizes)
        top = float(np.abs(sample_wave(ks, phases, sizes)).max())
        columns.append(target.amplitude_rad / top * wave(ks, phases, samples, sizes))
    return np.column_stack(columns), dealt


def _gain(target: SurfaceTarget, frequency_hz: Array) -> Array:
    """How much more a mode answers at frequencies than at rest, shape (f,)."""
    s = 2j * np.pi * frequency_hz
    return np.asarray(np.prod([np.abs(pole) / np.abs(s - pole) for pole in target.poles], axis=0))
