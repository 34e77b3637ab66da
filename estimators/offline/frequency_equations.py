"""A manoeuvre's equations in the frequency domain, as the equation error of that domain takes them.

At the samples a force equation is algebra. A state's derivative is 2 pi j f times its transform and the jump between
its ends; what a line between samples misses of that, the model says (``curved``).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.regression import NoiseModel, equations, noise_model
from wingwatch.estimators.offline.transform import harmonics_hz, noise_power, transform

__all__ = ["Curvature", "ManoeuvreBins", "curved", "manoeuvre_bins"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Curvature:
    """Step squared over twelve; 2 pi j f; transforms of the scaled inputs' slopes (bins, inputs); known part of A."""

    size: float
    s: Complex
    slopes: Complex
    known: Array


@dataclass(frozen=True, slots=True)
class ManoeuvreBins:
    """One manoeuvre in the frequency domain.

    Attributes:
        left: y, (bins, equations).
        right: R, (bins, equations, regressors).
        states: (bins, states).
        curvature: what the states' curvature between samples is made of, see ``curved``.
        own: columns of trims and jumps, (bins, own).
        power: of unit white noise, (bins,).
        noise: how the sensors' noise gets into both sides.
        scale: mean factor of the regressors, (regressors,).
        forces: equations that rest on an accelerometer, (equations,).
    """

    left: Complex
    right: Complex
    states: Complex
    curvature: Curvature
    own: Complex
    power: Array
    noise: NoiseModel
    scale: Array
    forces: NDArray[np.bool_]


def manoeuvre_bins(
    part: Manoeuvre, forces: NDArray[np.bool_], band_hz: tuple[float, float], drift: bool
) -> ManoeuvreBins:
    """A manoeuvre's equations in a band, with a drift of each equation where ``drift``; ``forces``: which equations are
    by accelerometer, (equations,)."""
    eq = equations(part, forces, drift)
    ns = eq.rates.shape[1]
    f = harmonics_hz(band_hz, part.duration_s)
    s = np.asarray(2j * np.pi * f, dtype=np.complex128)
    n, dt = len(part), part.dt
    held = np.zeros((n - 1, eq.regressors.shape[1]), dtype=bool)
    held[:, ns:] = part.held_steps
    # at the samples a force equation is algebra, so any interpolation serves it if it is the same for all of its terms
    drawn, lines = transform(eq.regressors, dt, f, held), transform(eq.regressors, dt, f)
    right = np.where(forces[:, None], lines[:, None], drawn[:, None])
    states = transform(part.states, dt, f)
    moved = np.where(held[:, ns:], 0.0, np.diff(eq.regressors[:, ns:], axis=0) / dt)
    slopes = transform(np.vstack([moved, moved[-1:]]), dt, f, np.ones_like(held[:, ns:]))
    curvature = Curvature(dt**2 / 12.0, s, slopes, part.known.mean(axis=0))
    left = transform(eq.direct, dt, f) + s[:, None] * (states @ eq.rates.T)
    trims = transform(eq.trims - eq.trims.mean(axis=0), dt, f)
    whole = np.linalg.norm(trims, axis=0) > 1e-9 * part.duration_s
    own = np.column_stack([np.ones(f.size), trims[:, whole]])
    power = noise_power(dt, part.duration_s, f)
    return ManoeuvreBins(
        left, right, states, curvature, own, power, noise_model(part, eq, s), part.regressor_scale, forces
    )


def curved(b: ManoeuvreBins, a: Array) -> tuple[Complex, Complex]:
    """y and R with the states' curvature between samples, as the model has it.

    A line between samples misses dt^2/12 of the second derivative's transform, and within a step that is
    x'' = A x' + B u'. (The real constant that the ends of x' would add is one of the jumps.) ``a``: A and B of the
    present derivatives, (equations, states + inputs).
    """
    ne, ns = a.shape[0], b.states.shape[1]
    whole = b.curvature.known.copy()
    whole[:ne] += a[:, :ns] * b.scale[:ns]
    second = b.curvature.s[:, None] * (b.states @ whole.T)
    second[:, :ne] += b.curvature.slopes @ a[:, ns:].T
    missed = -b.curvature.size * second
    left = b.left + ~b.forces * np.einsum("bij,bj->bi", b.noise.plain, missed)
    right = b.right.copy()
    right[:, :, :ns] += ~b.forces[:, None] * b.scale[:ns] * missed[:, None]
    return left, right
