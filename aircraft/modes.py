"""Natural frequency, damping and time constants of modes, with standard errors, and the analysis band that follows."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.linearisation import linearised_derivatives, trimmed
from wingwatch.aircraft.state_space import known_terms, state_space
from wingwatch.aircraft.structures import ModeStructure

__all__ = [
    "ModeQuantity",
    "analysis_band_hz",
    "mode_quantities",
    "natural_frequency_and_damping",
    "state_matrix",
]

Array = NDArray[np.float64]

_BAND_LOW, _BAND_HIGH = 0.055, 2.2
"""The thesis's band over its short period: 0.1 to 4 Hz at 11.373 rad/s = 1.810 Hz (chapters 7 to 9)."""

_REAL = 1e-9
"""Imaginary part, over the fastest root, below which a root is real: rounding of the eigenvalues."""


@dataclass(frozen=True, slots=True)
class ModeQuantity:
    """One figure of one mode.

    Attributes:
        mode: ``short_period``, ``phugoid``, ``dutch_roll``, ``roll``, ``spiral``; where the roots are not those of a
            conventional aircraft, ``oscillation_1``, ``aperiodic_1`` and so on, fastest first.
        name: ``natural_frequency_rad_s``, ``damping_ratio``, ``time_constant_s`` (of the envelope, -1 / real part), or
            ``time_constant_1_s`` and ``time_constant_2_s`` of a pair that does not oscillate, fast one first.
        value: NaN where there is none; a negative time constant or damping ratio is a divergence, an infinite time
            constant neutral.
        standard_error: of first order; infinite where the quantity has no finite slope there.
        unit: SI, empty for a ratio.
    """

    mode: str
    name: str
    value: float
    standard_error: float
    unit: str


def state_matrix(
    structure: ModeStructure,
    derivatives: Mapping[str, float],
    condition: FlightCondition | None = None,
    aircraft: Aircraft | None = None,
) -> Array:
    """A of ``dx/dt = A x + B u`` from concise derivatives, shape (states, states); see ``state_space``.

    ``condition`` (and ``aircraft`` for its alphadot terms) is needed by structures with attitudes, alpha or beta.
    """
    return state_space(structure, derivatives, condition, aircraft)[0]


def natural_frequency_and_damping(structure: ModeStructure, matrix: ArrayLike) -> tuple[float, float]:
    """Natural frequency in rad/s and damping ratio of a mode.

    For two states ``w_n² = det A``, ``2 ζ w_n = -trace A`` (thesis 9.4), also where the mode is overdamped.
    With more states they are those of the oscillatory pair of highest frequency.

    Args:
        structure: the mode's structure.
        matrix: A, shape (states, states).

    Returns:
        (natural_frequency_rad_s, damping_ratio); NaN for both where the mode has no natural frequency (a
        divergence, no oscillatory pair, or a matrix that is not finite).

    Raises:
        ValueError: a matrix of another shape.
    """
    a = np.asarray(matrix, dtype=np.float64)
    k = len(structure.all_states)
    if a.shape != (k, k):
        raise ValueError(f"the state matrix of {structure.name} has shape {(k, k)}, got {a.shape}")
    if not np.isfinite(a).all():
        return math.nan, math.nan
    if k == 2:
        square = float(a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
        if square <= 0.0:
            return math.nan, math.nan
        frequency = math.sqrt(square)
        return frequency, -float(a[0, 0] + a[1, 1]) / (2.0 * frequency)
    roots = np.linalg.eigvals(a)
    oscillatory = roots[roots.imag > _REAL * np.abs(roots).max()]
    if oscillatory.size == 0:
        return math.nan, math.nan
    root = complex(oscillatory[np.argmax(np.abs(oscillatory))])
    return abs(root), -root.real / abs(root)


def mode_quantities(
    structure: ModeStructure,
    derivatives: Mapping[str, float],
    covariance: ArrayLike,
    condition: FlightCondition | None = None,
    aircraft: Aircraft | None = None,
) -> tuple[ModeQuantity, ...]:
    """Natural frequency, damping ratio and time constants of a structure's modes, with standard errors.

    A pair of roots is judged by its sum s and product p: w_n = sqrt(p), damping ratio = -s / (2 w_n), envelope -2 / s.
    That holds for a pair that is overdamped too, and has no singular point at critical damping, as the roots
    themselves have. Errors are of first order (delta method): with P the spectral projector of the roots onto
    their invariant subspace, ds = tr(P dA), and for one root d(lambda) = tr(P dA) with P = x y' / (y' x) from its
    right and left eigenvectors.

    Args:
        structure: the structure; heading, which nothing depends on, is left out.
        derivatives: concise derivatives by symbol; NaN makes all quantities NaN.
        covariance: of the derivatives in the order of ``structure.derivatives``, shape (k, k); entries that are not
            finite make those quantities' errors infinite that hang on them.
        condition: needed by structures with attitudes, alpha or beta (``state_space``).
        aircraft: for its alphadot terms, where it has any.

    Returns:
        Fastest mode first; of each oscillation natural frequency, damping ratio and time constant(s), of each
        subsidence its time constant.

    Raises:
        KeyError: a derivative is absent.
        ValueError: a covariance of another shape, or no condition where one is needed.
    """
    k = len(structure.derivatives)
    spread = np.asarray(covariance, dtype=np.float64)
    if spread.shape != (k, k):
        raise ValueError(f"the covariance of {structure.name} has shape {(k, k)}, got {spread.shape}")
    a = state_matrix(structure, derivatives, condition, aircraft)
    if not np.isfinite(a).all():
        return _nothing(structure)
    scale = known_terms(structure, condition).row_scale
    n = len(structure.all_states) - ("psi" in structure.attitudes)
    a = a[:n, :n]
    out: list[ModeQuantity] = []
    for name, roots in _grouped(structure, [complex(r) for r in np.linalg.eigvals(a)]):
        projector, inside = _subspace(a, roots)
        gradients = [_gradient(structure, projector, scale)]
        if len(roots) == 2:
            adjugate = np.array([[inside[1][1, 1], -inside[1][0, 1]], [-inside[1][1, 0], inside[1][0, 0]]])
            gradients.append(_gradient(structure, inside[0] @ adjugate @ inside[2], scale))
        out += _described(name, inside[1], np.array(gradients), spread)
    return tuple(out)


def _nothing(structure: ModeStructure) -> tuple[ModeQuantity, ...]:
    """Quantities of derivatives that are not known."""
    nan = math.nan
    pairs = [
        ModeQuantity(mode, name, nan, nan, unit)
        for mode in structure.oscillations
        for name, unit in (
            ("natural_frequency_rad_s", "rad/s"),
            ("damping_ratio", ""),
            ("time_constant_s", "s"),
        )
    ]
    return tuple(pairs) + tuple(
        ModeQuantity(mode, "time_constant_s", nan, nan, "s") for mode in structure.subsidences
    )


def _grouped(structure: ModeStructure, roots: Sequence[complex]) -> list[tuple[str, tuple[complex, ...]]]:
    """Roots by mode, fastest first: conjugate pairs, real pairs in the place of an oscillation, single real roots."""
    order = sorted(roots, key=abs, reverse=True)
    fastest = abs(order[0])
    groups: list[tuple[complex, ...]] = [(r, r.conjugate()) for r in order if r.imag > _REAL * fastest]
    real = [complex(r.real) for r in order if abs(r.imag) <= _REAL * fastest]
    missing = len(structure.oscillations) - len(groups)
    if missing > 0 and not structure.subsidences and _adjacent(order, groups):
        groups += [(real[i], real[i + 1]) for i in range(0, 2 * missing, 2)]
        real = []
    groups.sort(key=lambda g: abs(g[0] * g[1]), reverse=True)
    usual = len(groups) == len(structure.oscillations) and len(real) == len(structure.subsidences)
    pairs = structure.oscillations if usual else [f"oscillation_{i + 1}" for i in range(len(groups))]
    singles = structure.subsidences if usual else [f"aperiodic_{i + 1}" for i in range(len(real))]
    named = list(zip(pairs, groups, strict=True)) + [(n, (r,)) for n, r in zip(singles, real, strict=True)]
    return sorted(named, key=lambda item: max(abs(r) for r in item[1]), reverse=True)


def _adjacent(order: list[complex], pairs: list[tuple[complex, ...]]) -> bool:
    """Whether no oscillation lies between real roots: then these are fast and slow pairs that do not oscillate."""
    return all(min(order.index(root) for root in pair) % 2 == 0 for pair in pairs)


def _subspace(a: Array, roots: tuple[complex, ...]) -> tuple[Array, tuple[Array, Array, Array]]:
    """Projector onto the invariant subspace of some roots, and (X, M, Y) with P = X Y, M = Y A X.

    The subspace is the null space of the real polynomial of A that has these roots; it is well defined where
    the roots are double, too, as long as the others are elsewhere.
    """
    size, eye = len(roots), np.eye(a.shape[0])
    if size == a.shape[0]:
        return eye, (eye, a, eye)
    if size == 1:
        polynomial = a - roots[0].real * eye
    else:
        polynomial = a @ a - (roots[0] + roots[1]).real * a + (roots[0] * roots[1]).real * eye
    left, _, right = np.linalg.svd(polynomial)
    x, y = right[-size:].T, left[:, -size:].T
    overlap = y @ x
    if abs(np.linalg.det(overlap)) < 1e-12:  # roots that others repeat: no slope of their own
        y = np.full_like(y, np.inf)
        return np.full_like(a, np.inf), (x, np.diag([r.real for r in roots]), y)
    y = np.linalg.solve(overlap, y)
    return x @ y, (x, y @ a @ x, y)


def _gradient(structure: ModeStructure, factor: Array, scale: Array) -> Array:
    """tr(factor dA) by each derivative, shape (k,): dA has the equation's scale at (equation, state)."""
    e, k = len(structure.equations), len(structure.states)
    by_place = np.zeros((e, len(structure.regressors)))
    by_place[:, :k] = factor.T[:e, :k] * scale[:, None]
    return by_place.ravel()


def _described(mode: str, inside: Array, gradients: Array, spread: Array) -> list[ModeQuantity]:
    """Quantities of one mode from the matrix within its subspace and the gradients of its sum and product."""
    if len(gradients) == 1:
        return [_time_constant(mode, "time_constant_s", float(inside[0, 0]), gradients[0], spread)]
    by_sum, by_product = gradients
    total = float(np.trace(inside))
    product = float(inside[0, 0] * inside[1, 1] - inside[0, 1] * inside[1, 0])
    frequency = math.sqrt(product) if product > 0.0 else math.nan
    damping = -total / (2.0 * frequency) if product > 0.0 else math.nan
    by_frequency = by_product / (2.0 * frequency)
    by_damping = -(by_sum + 2.0 * damping * by_frequency) / (2.0 * frequency)
    out = [
        ModeQuantity(mode, "natural_frequency_rad_s", frequency, _error(by_frequency, spread), "rad/s"),
        ModeQuantity(mode, "damping_ratio", damping, _error(by_damping, spread), ""),
    ]
    inner = 0.25 * total * total - product
    if inner < 0.0:
        return [*out, _time_constant(mode, "time_constant_s", 0.5 * total, 0.5 * by_sum, spread)]
    reach = math.sqrt(inner)
    by_reach = (
        (0.5 * total * by_sum - by_product) / (2.0 * reach) if reach > 0.0 else np.full_like(by_sum, np.inf)
    )
    pair = [(0.5 * total + sign * reach, 0.5 * by_sum + sign * by_reach) for sign in (1.0, -1.0)]
    pair.sort(key=lambda item: abs(item[0]), reverse=True)
    return out + [
        _time_constant(mode, f"time_constant_{i + 1}_s", root, slope, spread)
        for i, (root, slope) in enumerate(pair)
    ]


def _time_constant(mode: str, name: str, root: float, slope: Array, spread: Array) -> ModeQuantity:
    """-1 / root."""
    if root == 0.0:
        return ModeQuantity(mode, name, math.inf, math.inf, "s")
    return ModeQuantity(mode, name, -1.0 / root, _error(slope / root**2, spread), "s")


def _error(gradient: Array, spread: Array) -> float:
    """sqrt(g' C g); infinite where a slope or a variance that counts is, NaN where the quantity is none."""
    with np.errstate(invalid="ignore"):
        total = float(gradient @ spread @ gradient)
    if math.isfinite(total):
        return math.sqrt(max(0.0, total))
    if np.isnan(gradient).any():
        return math.nan
    counts = gradient != 0.0
    g, c = gradient[counts], spread[np.ix_(counts, counts)]
    if not (np.isfinite(g).all() and np.isfinite(c).all()):
        return math.inf
    return math.sqrt(max(0.0, float(g @ c @ g)))


def _cruise_matrix(aircraft: Aircraft, structure: ModeStructure) -> Array:
    stated = next((entry for entry in aircraft.conditions if entry.covers(structure)), None)
    if stated is not None:
        values = {symbol: entry.value for symbol, entry in stated.derivatives.items()}
        return state_matrix(structure, values, stated.condition, aircraft)
    if aircraft.envelope is None:
        raise AircraftDataError(
            f"aircraft {aircraft.name} states no [modes.{structure.name}] band_hz and no [envelope] "
            "to derive it at; add one of them to its file"
        )
    cruise = aircraft.envelope.cruise
    values = linearised_derivatives(aircraft, cruise, structure)
    if not structure.attitudes and not {"alpha", "beta"} & set(structure.states):
        return state_matrix(structure, values)
    return state_matrix(structure, values, trimmed(aircraft, cruise), aircraft)


def analysis_band_hz(aircraft: Aircraft, structure: ModeStructure) -> tuple[float, float]:
    """Analysis band (lowest, highest) in Hz of a mode.

    The file's ``[modes.<structure>] band_hz`` where it is stated, else that of the mode's frequency at cruise.

    Raises:
        AircraftDataError: neither the band nor anything to derive it from is stated.
        TrimError: cruise is no possible level flight.
    """
    stated = aircraft.modes.get(structure.name)
    return _default_band_hz(aircraft, structure) if stated is None else stated.band_hz


def _default_band_hz(aircraft: Aircraft, structure: ModeStructure) -> tuple[float, float]:
    """Analysis band of a mode from its frequency at cruise, in Hz.

    0.055 times the frequency of the oscillation (of the slowest, in a full motion) to 2.2 times that of the fastest
    root: the ratio of the thesis's band to its short period. A mode that does not oscillate has its one root for
    both. Cruise is the first of [[conditions]] that states the mode, else that of [envelope].
    """
    a = _cruise_matrix(aircraft, structure)
    roots = np.linalg.eigvals(a)
    fastest = float(np.abs(roots).max())
    frequency, _ = natural_frequency_and_damping(structure, a)
    slow = fastest if math.isnan(frequency) else frequency
    if structure.attitudes:
        oscillatory = np.abs(roots[roots.imag > _REAL * fastest])
        slow = float(oscillatory.min()) if oscillatory.size else fastest
    return _BAND_LOW * slow / (2.0 * math.pi), _BAND_HIGH * fastest / (2.0 * math.pi)
