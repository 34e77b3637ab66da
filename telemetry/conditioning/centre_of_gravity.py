"""Where inertial sensors sit from one another, and the centre of gravity among them (thesis 10.4); even sampling.

Two accelerometers on a rigid body differ by f2 - f1 = omega-dot x r + omega x (omega x r), r = r2 - r1: by least
squares that gives r, and nothing of the centre of gravity, which cancels. For that the force itself is needed: at the
centre c the specific force is aerodynamic, and f_i = f_c + A (r_i - c) with A of ``positions.lever_matrix``.

Angular accelerations do not tell c: they are as linear in flow, rates and surfaces as the force is, so a lever times
them passes for derivatives and back. What does are products of rates (p r, p q, p^2 ...), which a linear force has
not: they are the instruments. So c is seen in turns and rolls, its x by p r and p q; straight and level flight does not
tell it. Elevator to trim tells a shift of c as well, by other physics (``estimators.static_derivatives``).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.delays import coloured_spread
from wingwatch.telemetry.conditioning.parameter import Parameter
from wingwatch.telemetry.conditioning.positions import FORCES, RATES, lever_matrix
from wingwatch.telemetry.conditioning.sensor_noise import detrended
from wingwatch.telemetry.conditioning.spectra import make_bins, noise_floor, smoothed_power
from wingwatch.telemetry.conditioning.windows import even_window, runs, slopes
from wingwatch.telemetry.sample import CHANNEL_INDEX, SampleBlock

__all__ = ["centre_of_gravity", "centre_shift", "imu_separation"]

Array = NDArray[np.float64]

_AXES = ("x", "y", "z")
_UNKNOWN_M = 1.0
"""A place whose standard error is not below this is not known at all."""
_SIGNAL = 0.1
"""Least share of signal in what the gyros' rates of change say; below it their noise leads."""
_MEMORY_S = 1.0
"""Residuals farther apart count as independent."""


def imu_separation(
    block: SampleBlock, second_forces_m_s2: Array, band_hz: tuple[float, float] = (0.2, 4.0)
) -> tuple[Parameter, ...]:
    """Place of a second accelerometer triad from the first, body axes, by what they read apart.

    Least squares over the bins of a tapered window (``spectra``), each equation weighted by its own residual, what the
    gyros' noise adds to the regressors' power taken away. A constant difference (biases) lies below the band.

    Args:
        block: samples with rates and the first triad's forces.
        second_forces_m_s2: the second triad's at the same stamps, shape (n, 3).
        band_hz: frequencies that are used; quicker than a tenth of the sample rate, slopes and readings part.

    Returns:
        x, y, z of the separation in m; not observable where the aircraft does not turn about an axis across.

    Raises:
        ValueError: shapes differ or no complete window is long enough.
    """
    second = _same_rows(block, second_forces_m_s2)
    difference = second - np.stack([block.column(n) for n in FORCES], axis=1)
    carried = block.values.copy()
    carried[:, [CHANNEL_INDEX[n] for n in FORCES]] = difference
    time_s, columns = even_window(SampleBlock(carried), (*RATES, *FORCES))
    bins = make_bins(len(time_s), float(time_s[1] - time_s[0]), band_hz)
    rates = np.stack([columns[n] for n in RATES], axis=1)
    products = lever_matrix(rates, np.zeros_like(rates)) - np.mean(
        lever_matrix(rates, np.zeros_like(rates)), axis=0
    )
    turning = np.zeros((bins.omega_rad_s.size, 3, 3), dtype=np.complex128)
    noise = np.zeros((bins.omega_rad_s.size, 3, 3))
    for j, (plus, minus) in enumerate(_TURNS):
        spin = bins.of_rate(detrended(rates[:, j]))
        turning[:, plus[0], plus[1]], turning[:, minus[0], minus[1]] = spin, -spin
        power = bins.omega_rad_s**2 * noise_floor(bins, detrended(rates[:, j]))
        noise[:, plus[0], plus[1]] = noise[:, minus[0], minus[1]] = power
    for row in range(3):
        for column in range(3):
            turning[:, row, column] += bins.of(products[:, row, column])
    read = np.stack([bins.of(columns[n] - np.mean(columns[n])) for n in FORCES], axis=1)
    value, covariance = _least_squares(turning, noise, read, bins.overlap)
    return tuple(_place(f"separation {axis}", value[i], covariance[i, i]) for i, axis in enumerate(_AXES))


_TURNS = (((2, 1), (1, 2)), ((0, 2), (2, 0)), ((1, 0), (0, 1)))
"""Where the lever matrix has the rate of p, q and r: with its sign, and against it."""


def _least_squares(
    design: NDArray[np.complex128], noise: Array, read: NDArray[np.complex128], overlap: float
) -> tuple[Array, Array]:
    """Noise-compensated least squares over bins and three equations, and its covariance (k, k).

    Args:
        design: shape (bins, 3, k).
        noise: of the design's power, shape (bins, 3, k).
        read: shape (bins, 3).
        overlap: of the bins.
    """
    k = design.shape[2]
    value, covariance = np.zeros(k), np.full((k, k), np.inf)
    for _ in range(3):
        left = read - design @ value
        weight = 1.0 / np.maximum(np.stack([smoothed_power(np.abs(e) ** 2) for e in left.T], axis=1), 1e-300)
        power = np.real(np.einsum("bej,bek,be->jk", np.conj(design), design, weight))
        curvature = power - np.diag(np.einsum("bej,be->j", noise, weight))
        size = np.sqrt(np.diagonal(power))
        # where noise may be all there is, what is left after taking it away is chance
        if float(np.min(np.linalg.eigvalsh(curvature / np.outer(size, size)))) < _SIGNAL:
            return value, np.full((k, k), np.inf)
        inverse = np.linalg.inv(curvature)
        value = inverse @ np.real(np.einsum("bej,be,be->j", np.conj(design), read, weight))
        covariance = inverse @ (0.5 * overlap * power) @ inverse
    return value, covariance


def centre_of_gravity(
    block: SampleBlock,
    positions_m: Sequence[tuple[float, float, float]],
    other_forces_m_s2: Sequence[Array] = (),
) -> tuple[Parameter, ...]:
    """Place of the centre of gravity in the axes and from the point that the sensors' places are given in.

    Across and down the specific force is taken as linear: rho V^2 times (1, alpha, alpha^2, beta^2, elevator) and
    rho V times q; rho V^2 times (1, beta, aileron, rudder) and rho V times p and r; and a constant (bias).

    Args:
        block: samples with rates, forces of the first triad, vanes, surfaces, airspeed and density, aligned.
        positions_m: place of each triad, the first being that of the block.
        other_forces_m_s2: forces of the others at the same stamps, each shape (n, 3); with two or more their mean
            counts, at their mean place.

    Returns:
        x, y, z in m; not observable where rates of several axes hardly go together.

    Raises:
        ValueError: a channel is missing, shapes differ or fewer than 64 samples are complete.
    """
    if len(positions_m) != 1 + len(other_forces_m_s2):
        raise ValueError(
            f"{len(positions_m)} places and {1 + len(other_forces_m_s2)} triads of forces: give one place a triad"
        )
    columns = {name: _needed(block, name) for name in (*RATES, *FORCES, *_LINEAR)}
    rates = np.stack([columns[n] for n in RATES], axis=1)
    triads = [np.stack([columns[n] for n in FORCES], axis=1)]
    triads += [_same_rows(block, forces) for forces in other_forces_m_s2]
    still, time_s = np.zeros_like(rates), block.time_s
    products = _as_slopes(time_s, lever_matrix(rates, still).reshape(-1, 9)).reshape(-1, 3, 3)
    lever = products + lever_matrix(still, slopes(time_s, rates))
    at_origin = _as_slopes(time_s, np.mean(triads, axis=0)) - lever @ np.mean(np.asarray(positions_m), axis=0)
    across, down = (_as_slopes(time_s, part) for part in _linear_forces(columns))
    good = (
        np.isfinite(at_origin).all(axis=1) & np.isfinite(across).all(axis=1) & np.isfinite(down).all(axis=1)
    )
    _enough(good)
    n, k = int(good.sum()), across.shape[1] + down.shape[1]
    design, instrument = np.zeros((n, 2, 3 + k)), np.zeros((n, 2, 3 + k))
    design[:, :, :3], instrument[:, :, :3] = -lever[good][:, 1:], -products[good][:, 1:]
    for matrix in (design, instrument):
        matrix[:, 0, 3 : 3 + across.shape[1]] = across[good]
        matrix[:, 1, 3 + across.shape[1] :] = down[good]
    read = at_origin[good][:, 1:]
    weight = np.ones(2)
    for _ in range(2):
        value, covariance = _instruments(design, instrument, read, weight, _lags(block))
        weight = 1.0 / np.maximum(np.var(read - design @ value, axis=0), 1e-12)
    return tuple(_place(f"centre {axis}", value[i], covariance[i, i]) for i, axis in enumerate(_AXES))


def centre_shift(before: Parameter, after: Parameter) -> Parameter:
    """How far a place moved between two estimates; observable where that is more than three standard errors."""
    if not (before.observable and after.observable):
        reason = (before if not before.observable else after).reason
        return Parameter("shift", math.nan, math.inf, "m", False, reason)
    shift, error = after.value - before.value, math.hypot(before.standard_error, after.standard_error)
    reason = "" if abs(shift) > 3.0 * error else f"it is within three standard errors of zero ({error:.2g} m)"
    return Parameter("shift", shift, error, "m", not reason, reason)


_LINEAR = (
    "airspeed_true_m_s", "air_density_kg_m3", "angle_of_attack_rad", "sideslip_rad",
    "elevator_rad", "aileron_rad", "rudder_rad",
)  # fmt: skip


def _linear_forces(c: dict[str, Array]) -> tuple[Array, Array]:
    """Regressors of the force across (n, 7) and down (n, 7), each scaled to the order of one."""
    speed, density = c["airspeed_true_m_s"], c["air_density_kg_m3"]
    pressure = density * speed**2 / np.nanmean(density * speed**2)
    slow = density * speed / np.nanmean(density * speed)
    p, q, r = (c[n] for n in RATES)
    alpha, beta = c["angle_of_attack_rad"], c["sideslip_rad"]
    one = np.ones_like(speed)
    across = [one, pressure, pressure * beta, slow * p, slow * r]
    across += [pressure * c["aileron_rad"], pressure * c["rudder_rad"]]
    down = [one, pressure, pressure * alpha, pressure * alpha**2, pressure * beta**2, slow * q]
    down += [pressure * c["elevator_rad"]]
    return np.stack(across, axis=1), np.stack(down, axis=1)


def _instruments(
    design: Array, instrument: Array, read: Array, weight: Array, lags: int
) -> tuple[Array, Array]:
    """Solution of sum Z' (y - X theta) = 0 over samples and equations, and its covariance for coloured residuals.

    Args:
        design: X, shape (n, equations, k).
        instrument: Z, the same shape.
        read: y, shape (n, equations).
        weight: of the equations.
        lags: samples over which residuals go together.
    """
    size = np.maximum(np.sqrt(np.mean(instrument**2, axis=(0, 1))), 1e-12)
    weighted = instrument / size * weight[:, None]
    inverse = np.linalg.pinv(np.einsum("nek,nel->kl", weighted, design / size), rcond=1e-12)
    value = inverse @ np.einsum("nek,ne->k", weighted, read) / size
    scores = np.einsum("nek,ne->nk", weighted, read - design @ value)
    covariance = inverse @ coloured_spread(scores, lags) @ inverse.T
    return value, covariance / np.outer(size, size)


def _as_slopes(time_s: Array, values: Array) -> Array:
    """Values (n, k) averaged as ``slopes`` averages a rate, so that both lose the same of what is quick.

    Its weights, summed up, are those of the rate's means over steps; these follow from four values to the fourth order.
    """
    inner = np.array([-22.0, 45.0, 103.0, 103.0, 45.0, -22.0]) / 252.0
    kernel = np.convolve(inner, np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0)
    out = np.full(values.shape, np.nan)
    reach = kernel.size // 2
    for run in runs(time_s):
        part = values[run]
        if len(part) >= kernel.size:
            smooth = np.stack([np.convolve(column, kernel, mode="valid") for column in part.T], axis=1)
            out[run][reach:-reach] = smooth
    return out


def _place(name: str, value: float, variance: float) -> Parameter:
    error = math.sqrt(max(float(variance), 0.0))
    if not 0.0 < error < _UNKNOWN_M:
        reason = "the flight turns too little about several axes at once"
        return Parameter(name, math.nan, math.inf, "m", False, reason)
    return Parameter(name, float(value), error, "m")


def _lags(block: SampleBlock) -> int:
    return max(1, round(_MEMORY_S / float(np.median(np.diff(block.time_s)))))


def _same_rows(block: SampleBlock, forces: Array) -> Array:
    if forces.shape != (len(block), 3):
        raise ValueError(
            f"forces have the shape {forces.shape}; give one row of three a sample, ({len(block)}, 3)"
        )
    return np.asarray(forces, dtype=np.float64)


def _needed(block: SampleBlock, name: str) -> Array:
    column = block.column(name)
    if not np.isfinite(column).any():
        raise ValueError(f"the flight has no {name}: the centre of gravity cannot be found without it")
    return column


def _enough(good: NDArray[np.bool_]) -> None:
    if int(good.sum()) < 64:
        raise ValueError(f"{int(good.sum())} samples are complete: at least 64 are needed")
