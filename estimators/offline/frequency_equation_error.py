"""Equation error in the frequency domain with the chirp-z transform, on files (thesis chapter 8).

Where (8.10) weighs all bins alike, both equations are here solved together with the weight that sensor noise gives
them, and its products in the regressors are taken out, as the recursive Fourier estimator does on streams
(docs/methods/offline.md, section 4). Bins are multiples of one over the manoeuvre's length: trim has no part in
them, and the jump between a state's ends, which its derivative's transform needs, is an unknown of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.offline.bin_residuals import (
    BinResiduals,
    as_found,
    beyond_chance,
    covariance_of,
    difference,
)
from wingwatch.estimators.offline.endogeneity import left_unexplained, may_be_off, surface_response
from wingwatch.estimators.offline.fit import ChannelFit, Fit, channel_fit
from wingwatch.estimators.offline.frequency_equations import ManoeuvreBins, curved, manoeuvre_bins
from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.regression import (
    ReferredEstimate,
    Solution,
    SolverReport,
    common_forces,
    corrected_step,
    equation_names,
    finished,
    left_over,
    noise_names,
    plain_start,
    shared_config,
    signal_share,
    stated_noise,
)
from wingwatch.estimators.offline.transform import transform

__all__ = ["FrequencyEquationErrorConfig", "frequency_equation_error"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

NAME = "frequency-equation-error"

_CHANCE = 0.01
"""Chance that a residual as large as the sensors' noise makes it is called larger, or smaller."""


_SILENT = 1e-20
"""Of a reading's power: noise below it is rounding."""

_FAINT = 1e-12
"""Of a reading's power: noise below it is not looked for in the residuals, which interpolation alone leaves larger."""


@dataclass(frozen=True, slots=True)
class FrequencyEquationErrorConfig:
    """Which bins, and how they are solved.

    Attributes:
        band_hz: lowest and highest frequency.
        drift: whether each equation has a drift of its own in each manoeuvre.
        force_from_accelerometer: whether force equations rest on accelerometers where there are any.
        noise_std: of states, the equations' accelerometers and inputs, (states + equations + inputs,); from their
            third differences where empty.
        iterations: most of them.
        tolerance: ends when a step moves no combination of derivatives by more than this share of its error.
    """

    band_hz: tuple[float, float]
    drift: bool = True
    force_from_accelerometer: bool = True
    noise_std: tuple[float, ...] = ()
    iterations: int = 40
    tolerance: float = 1e-3


@dataclass(slots=True)
class _Sums:
    """Normal equations of all manoeuvres at one linearisation, derivatives only.

    Attributes:
        matrix, noise: information and what noise adds to it, (k, k); score: (k,).
        bins: of each manoeuvre, with their residuals.
        predicted: (bins, equations); sources: power of the residuals from each sensor's noise,
            (bins, equations, noises); expected: the sum of that.
        inner: inverse information of the trims and jumps of each manoeuvre.
        own: trims and jumps of an equation in all manoeuvres.
    """

    matrix: Array
    noise: Array
    score: Array
    bins: list[BinResiduals]
    predicted: list[Complex]
    sources: list[Array]
    expected: list[Array]
    inner: list[Array]
    own: int


@dataclass(frozen=True, slots=True)
class _Found:
    """Where the iterations ended.

    Attributes:
        theta: (k,); sums: there.
        step: the last one.
        variance: of the sensors' noise, (noises,); excess: of each equation's residual over it, (equations,).
        moved: by how much another sensor noise than the readings' own would move theta, (k,).
        iterations: how many; settled: whether theta came to rest.
    """

    theta: Array
    sums: _Sums
    step: Solution
    variance: Array
    excess: Array
    moved: Array
    iterations: int
    settled: bool


def frequency_equation_error(
    parts: Sequence[Manoeuvre], config: FrequencyEquationErrorConfig, *, natural: Array | None = None
) -> tuple[Estimate, Fit]:
    """Derivatives by equation error in the frequency domain.

    Args:
        parts: manoeuvres of one config.
        config: see there.
        natural: natural size of each concise derivative, (k,), for its outcome.

    Returns:
        Estimate at the mean condition of the manoeuvres, and the statistics of the fit over the bins.

    Raises:
        ValueError: no manoeuvre, manoeuvres of different configs, or a band with fewer bins than unknowns.
    """
    shared = shared_config(parts)
    ne = len(shared.structure.equations)
    forces = common_forces(parts) & config.force_from_accelerometer
    variance = stated_noise(parts, forces, config.noise_std)
    bins = [manoeuvre_bins(part.even(), forces, config.band_hz, config.drift) for part in parts]
    width = len(shared.structure.regressors)
    if sum(b.power.size for b in bins) <= width + max(b.own.shape[1] for b in bins):
        raise ValueError(
            f"band_hz {config.band_hz} holds {sum(b.power.size for b in bins)} bins of these manoeuvres, too few for "
            f"{width} derivatives an equation; widen the band or take longer manoeuvres"
        )
    start = plain_start(parts) if forces.any() == common_forces(parts).any() else np.zeros(ne * width)
    return _report(
        parts, bins, _iterated(bins, start, variance, _reading_power(parts), config), forces, natural
    )


def _iterated(
    bins: Sequence[ManoeuvreBins],
    theta: Array,
    variance: Array,
    readings: Array,
    config: FrequencyEquationErrorConfig,
) -> _Found:
    """From ``theta`` to where a step moves it no more; ``readings`` is their mean square, (noises,)."""
    ne, width = bins[0].left.shape[1], bins[0].right.shape[2]
    variance = first = np.maximum(variance, 1e-24 * readings)
    share = signal_share(width, float(sum(b.power.size for b in bins)))
    excess = np.ones(ne)
    settled, iteration = False, 0
    for iteration in range(1, config.iterations + 1):
        sums = _sums(bins, theta, variance, excess)
        solution = corrected_step(sums.matrix, sums.noise, sums.score, share)
        theta = theta + solution.step
        if float(solution.step @ sums.matrix @ solution.step) * 2.0 <= config.tolerance**2:
            settled = True
            break
        if iteration >= 3:
            variance, excess = _levels(sums, variance, width)
            variance = np.maximum(variance, np.minimum(first, _FAINT * readings))
    sums = _sums(bins, theta, variance, excess)
    moved = np.zeros_like(theta)
    if (variance != first).any():
        at_first = _sums(bins, theta, first, excess)
        moved = corrected_step(at_first.matrix, at_first.noise, at_first.score, share).step
    return _Found(theta, sums, solution, variance, excess, moved, iteration, settled)


def _reading_power(parts: Sequence[Manoeuvre]) -> Array:
    """Mean square of each reading about its mean, as in ``sensor_noise``, so that no noise is below rounding."""
    columns = np.concatenate([np.column_stack([p.states, p.accelerometer, p.inputs]) for p in parts])
    power = np.nan_to_num(columns.var(axis=0))
    return np.asarray(np.maximum(power, 1e-12))


def _sums(bins: Sequence[ManoeuvreBins], theta: Array, variance: Array, excess: Array) -> _Sums:
    """Information, its noise, and the score at ``theta`` with trims eliminated."""
    k = theta.size
    out = _Sums(np.zeros((k, k)), np.zeros((k, k)), np.zeros(k), [], [], [], [], [], 0)
    for b in bins:
        _add(out, b, theta, variance, excess)
    return out


def _add(out: _Sums, b: ManoeuvreBins, theta: Array, variance: Array, excess: Array) -> None:
    ne, width = b.left.shape[1], b.right.shape[2]
    own = b.own.shape[1]
    a = theta.reshape(ne, width)
    noise_to_residual = b.noise.residual(a * b.scale)
    expected = b.power[:, None, None] * np.einsum(
        "bij,j,bkj->bik", noise_to_residual, variance, noise_to_residual.conj(), optimize=True
    )
    weight = np.linalg.inv(expected * np.sqrt(np.outer(excess, excess)))
    left, right = curved(b, a)
    columns = np.concatenate([right, np.repeat(b.own[:, None], ne, axis=1)], axis=2)
    full = np.einsum("bim,bij,bjn->imjn", columns.conj(), weight, columns, optimize=True).real
    residual = left - np.einsum("bim,im->bi", right, a)
    vector = np.einsum("bim,bij,bj->im", columns.conj(), weight, residual, optimize=True).real
    theirs = np.ix_(range(ne), range(width, width + own))
    m_oo = full[:, width:, :, width:].reshape(ne * own, ne * own)
    m_co = full[:, :width, :, width:].reshape(ne * width, ne * own)
    inner = np.linalg.pinv(m_oo, rcond=1e-12, hermitian=True)
    trims = (inner @ vector[theirs].reshape(-1)).reshape(ne, own)
    # trims take their share of the noise with them: in the mean half a real coefficient's of a complex bin
    lifted = np.einsum("bij,bo->bijo", weight, b.own).reshape(b.power.size, ne, ne * own)
    seen = weight - 0.5 * np.einsum("bio,op,bjp->bij", lifted, inner, lifted.conj(), optimize=True)
    answer = np.einsum("bij,bjl->bil", seen, noise_to_residual)
    common = b.noise.of_regressors.conj() * variance
    g = np.einsum("b,bml,bil->im", b.power, common, answer, optimize=True).real
    correction = g * b.scale
    products = np.einsum("bml,bnl->bmn", common, b.noise.of_regressors)
    noise = np.einsum("b,bij,bmn->imjn", b.power, seen, products, optimize=True).real
    noise *= b.scale[:, None, None] * b.scale
    left_over = residual - b.own @ trims.T
    weighted = np.einsum("bij,bj->bi", weight, left_over)
    direct = np.einsum("bim,bi->im", right.conj(), weighted).real
    out.bins.append(BinResiduals(_without_own(_by_equation(right), weight, b.own, inner), weight, left_over))
    out.matrix += full[:, :width, :, :width].reshape(ne * width, -1) - m_co @ inner @ m_co.T
    out.noise += noise.reshape(ne * width, ne * width)
    out.score += (direct - correction).reshape(-1)
    out.predicted.append(left - left_over)
    out.inner.append(inner)
    out.sources.append(b.power[:, None, None] * np.abs(noise_to_residual) ** 2 * variance)
    out.expected.append(np.einsum("bii->bi", expected).real)
    out.own += own


def _by_equation(columns: Complex) -> Complex:
    """Columns of each equation, (bins, equations, width), in the places of its derivatives, (bins, equations, k)."""
    bins, ne, width = columns.shape
    out = np.zeros((bins, ne, ne * width), dtype=np.complex128)
    for i in range(ne):
        out[:, i, i * width : (i + 1) * width] = columns[:, i]
    return out


def _without_own(columns: Complex, weight: Complex, own: Complex, inner: Array) -> Complex:
    """Columns (bins, equations, k) less what trims and jumps can be of them."""
    ne, k = columns.shape[1:]
    products = np.einsum("bo,bij,bjk->iok", own.conj(), weight, columns, optimize=True).real
    split = (inner @ products.reshape(-1, k)).reshape(ne, -1, k)
    return np.asarray(columns - np.einsum("bo,iok->bik", own, split))


def _levels(sums: _Sums, variance: Array, width: int) -> tuple[Array, Array]:
    """Sensor noise, and what each equation's residual has above it, from the residuals' power.

    Within chance the sensors' noise explains a residual. Above, the rest is the equation's own (gusts, model error) and
    weighs it down; below, the noise is not white and less of it lies within the band: each sensor bears as much of that
    as it has a share in the equation (to first order a step of expectation-maximisation).
    """
    ne = sums.expected[0].shape[1]
    variance, excess = variance.copy(), np.ones(ne)
    freedom = 2.0 * sum(len(e) for e in sums.expected) - width - sums.own
    for i, ratio in enumerate(_ratios(sums, freedom)):
        if ratio > scipy.stats.chi2.ppf(1.0 - _CHANCE, freedom) / freedom:
            excess[i] = ratio
        elif ratio < scipy.stats.chi2.ppf(_CHANCE, freedom) / freedom:
            shares = [s[:, i] / e[:, i, None] for s, e in zip(sums.sources, sums.expected, strict=True)]
            variance *= ratio ** np.concatenate(shares).mean(axis=0)
    return variance, excess


def _ratios(sums: _Sums, freedom: float) -> list[float]:
    """Power of each equation's residual over what the sensors' noise makes of it."""
    return [
        2.0
        * sum(
            float(np.sum(np.abs(b.residuals[:, i]) ** 2 / e[:, i]))
            for b, e in zip(sums.bins, sums.expected, strict=True)
        )
        / max(freedom, 1.0)
        for i in range(sums.expected[0].shape[1])
    ]


def _report(
    parts: Sequence[Manoeuvre],
    bins: Sequence[ManoeuvreBins],
    found: _Found,
    forces: NDArray[np.bool_],
    natural: Array | None,
) -> tuple[Estimate, Fit]:
    theta, sums, moved = found.theta, found.sums, found.moved
    config = parts[0].config
    ne = len(config.structure.equations)
    count = sum(len(e) for e in sums.expected)
    own = ne * sums.own
    freedom = 2.0 * count * ne - theta.size - own
    inverse = found.step.inverse
    white = 0.5 * inverse @ sums.matrix @ inverse
    names = equation_names(config, forces)
    channels = _channels(names, sums, theta.size / ne + sums.own)
    # the fit counts real and imaginary parts, of which each has half of a bin's power
    due = 0.5 * np.concatenate(sums.expected).mean(axis=0)
    width = theta.size // ne
    doubts = [left_over(c, float(due[i]), slice(i * width, (i + 1) * width)) for i, c in enumerate(channels)]
    spectra = as_found(sums.bins, inverse, 1.0 - own / (2.0 * count * ne))
    coloured = covariance_of([b.influence(inverse) for b in sums.bins], spectra)
    chosen = bool((found.excess > 1.0).any() or moved.any()) or beyond_chance(
        sums.bins, inverse, white, coloured
    )
    # where third differences were wrong, noise is known no better than by what that changed
    coloured = (
        coloured
        + np.outer(moved, moved)
        + _off(parts, bins, sums, theta, inverse, spectra, [d is None for d in doubts])
    )
    used = found.variance > _SILENT * _reading_power(parts)
    noise = {name: float(np.sqrt(found.variance[j])) for j, name in enumerate(noise_names(config)) if used[j]}
    referred = ReferredEstimate(theta, white, coloured, chosen, found.step.hidden)
    solver = SolverReport(sum(map(len, parts)), theta.size + own, found.iterations, found.settled, freedom)
    return finished(NAME, parts, referred, channels, noise, solver, natural, doubts)


def _off(
    parts: Sequence[Manoeuvre],
    bins: Sequence[ManoeuvreBins],
    sums: _Sums,
    theta: Array,
    inverse: Array,
    spectra: Sequence[Complex],
    holds: Sequence[bool],
) -> Array:
    """By how much what the sensors do not explain may have put the derivatives off, as a covariance, (k, k)."""
    ne = sums.expected[0].shape[1]
    width = theta.size // ne
    freedom = 2.0 * sum(len(e) for e in sums.expected) - width - sums.own
    tools: list[Complex] = []
    found = []
    for i, ratio in enumerate(_ratios(sums, freedom)):
        unexplained = left_unexplained(ratio, 1.0, freedom)
        if unexplained == 0.0:
            continue
        tools = tools or [
            _without_own(
                _by_equation(_instruments(p.even(), b, theta.reshape(ne, width))), r.weight, b.own, inner
            )
            for p, b, r, inner in zip(parts, bins, sums.bins, sums.inner, strict=True)
        ]
        own = slice(i * width, (i + 1) * width)
        power = [unexplained * e[:, i] for e in sums.expected]
        one = difference(sums.bins, tools, spectra, inverse, own, i, power)
        found.append(one if holds[i] else one.by_bound())
    return may_be_off(found) if found else np.zeros_like(inverse)


def _instruments(part: Manoeuvre, b: ManoeuvreBins, theta: Array) -> Complex:
    """What the surfaces alone make of the regressors, (bins, equations, regressors)."""
    ns = part.states.shape[1]
    out = b.right.copy()
    moved = surface_response(part, theta) * part.stability[:, None]
    out[:, :, :ns] = transform(moved, part.dt, b.curvature.s.imag / (2.0 * np.pi))[:, None]
    return out


def _channels(names: Sequence[str], sums: _Sums, taken: float) -> tuple[ChannelFit, ...]:
    """Fit of each equation over its bins, real and imaginary parts one after another."""
    channels = []
    for i, name in enumerate(names):
        y = [np.column_stack([p[:, i].real, p[:, i].imag]).reshape(-1) for p in sums.predicted]
        v = [np.column_stack([b.residuals[:, i].real, b.residuals[:, i].imag]).reshape(-1) for b in sums.bins]
        channels.append(channel_fit(name, [a + b for a, b in zip(y, v, strict=True)], y, taken))
    return tuple(channels)
