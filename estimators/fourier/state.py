"""Configuration, memory and workspaces of the recursive Fourier estimator, by name.

Axes, always in this order: vehicle (in front of all that follow, where a batch of vehicles is meant), channel or
equation, real and imaginary part, bin (frequency). k = states x (states + inputs) counts the derivatives, equation by
equation. Derivatives are aerodynamic and referred to the reference condition, in SI units with radians; information is
in their inverse squares.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.intersample import Servos

__all__ = [
    "AIRSPEED",
    "AIR_VARIANCES",
    "ALPHA",
    "ALTITUDE",
    "BEFORE",
    "BETWEEN",
    "CLOSED",
    "CONDITION",
    "COURSES",
    "DENSITY",
    "GUST",
    "LAST",
    "ROLLING",
    "SAMPLES",
    "SOLUTIONS",
    "START",
    "TIME",
    "WEIGHT",
    "Block",
    "BlockSolution",
    "Checkpoints",
    "Equation",
    "Evidence",
    "Filters",
    "Linearisation",
    "Memory",
    "Model",
    "Posterior",
    "Prior",
    "Progress",
    "State",
    "Transforms",
]

Array = NDArray[np.float64]

TIME = 0
"""Column of a signal row (``SignalLayout``)."""
CONDITION = 2
"""Columns from the kinematic term to the flight condition, which has the order of the next four names."""

AIRSPEED, DENSITY, ALTITUDE, ALPHA, SAMPLES, COURSES = range(6)
"""Places in ``Block.sums``; two for each input follow the last."""

START, LAST, BEFORE = range(3)
"""Rows of ``Block.rows``."""

AIR_VARIANCES = 3
"""Number of the air's variances, which are the last of ``Posterior.noise``."""
GUST, ROLLING, BETWEEN = -3, -2, -1
"""Of these: rate of the gust at the vane, (m/s2)^2; roll rate of the air before the span smooths it, (rad/s)^2; what
the gust does between samples beside a line, (m/s)^2, which follows from the first
(``noise.between_samples_variance``)."""
WEIGHT = -1
"""Place in ``Posterior.noise_known``."""

SOLUTIONS, CLOSED, CHANGED = range(3)
"""Places in ``Progress.counts``."""


class Prior(NamedTuple):
    """Derivatives before the data.

    Attributes:
        value, std: (k,) mean and standard deviation.
    """

    value: Array
    std: Array


class Model(NamedTuple):
    """What does not change; the same for all vehicles.

    Attributes:
        omega: (bins,) rad/s.
        lever: (states,) accelerometer's place from the c.g., by what each state's rate adds to the force, m.
        exponents: (states + inputs,) power of the airspeed in each column's derivatives: 1 states, 2 inputs.
        servos: ``Servos``.
        input_variance: (inputs,) noise variance as it is stated, rad^2; 0 of exact ones.
        prior: derivatives before the data.
        reference_airspeed_m_s, reference_density_kg_m3: condition to which derivatives are referred.
        block_s, first_solution_s, memory_s, stale_s, smallest_signal: of ``FourierConfig``.
        roll_smoothing_m, turn_smoothing_m: lengths over which the span smooths the air's roll rate, and its pitch or
            yaw rate; 0 where the air is not known to turn.
        vane_ahead_m: of the centre of gravity, at which the signals have its readings.
        by_accelerometer: whether the force equation rests on the accelerometer; else on the velocity's rate.
        longitudinal: whether the velocity is w; else v.
        roll: whether the second state is the roll rate.
    """

    omega: Array
    lever: Array
    exponents: Array
    servos: Servos
    input_variance: Array
    prior: Prior
    reference_airspeed_m_s: float
    reference_density_kg_m3: float
    block_s: float
    first_solution_s: float
    memory_s: float
    stale_s: float
    smallest_signal: float
    roll_smoothing_m: float
    turn_smoothing_m: float
    vane_ahead_m: float
    by_accelerometer: bool
    longitudinal: bool
    roll: bool


class Filters(NamedTuple):
    """One-pole filters of a time step, and what the readings have shown.

    Attributes:
        coefficients: (8, bins), rows as ``bank`` makes them, s where they multiply a signal.
        step: (1,) the time step they are for, s.
        readings: (inputs, READING_MEMORY), see ``kernels.reading_noise``.
    """

    coefficients: Array
    step: Array
    readings: Array


class Block(NamedTuple):
    """A window of samples, running or cut out.

    Attributes:
        bank: (channels, 2, bins) transforms, real and imaginary part; unit of the signal times s.
        rows: (3, columns) signal rows at the window's start, the last one and the one before.
        sums: (5 + 2 inputs,) over the window: airspeed (m/s), density (kg/m3), altitude (m), angle of attack (rad),
            number of samples; then of each input the square of its change over a step, rad2, and that times the
            variance of its mean over the step.
        roughness: (states + 2,) sums of the roots of magnitudes of second differences of states and accelerometer, and
            their number.
    """

    bank: Array
    rows: Array
    sums: Array
    roughness: Array


class Memory(NamedTuple):
    """An estimating equation of the derivatives, A theta = v, as blocks have added it up.

    Attributes:
        sensitivity: (k, k) A, expected change of the score with the derivatives.
        information: (k, k) C, covariance of v by the noise.
        vector: (k,) v.
        bias: (k,) part of v that is expected of moments which the equations leave out.
    """

    sensitivity: Array
    information: Array
    vector: Array
    bias: Array


class Evidence(NamedTuple):
    """Quadratic log-likelihood of the derivatives by one block alone.

    Attributes:
        information: (k, k) J.
        vector: (k,) h.
        bias: (k,) J times the bias that unmeasured moments may cause.
    """

    information: Array
    vector: Array
    bias: Array


class Posterior(NamedTuple):
    """What is known at the last solution.

    Attributes:
        theta: (k,) derivatives.
        covariance: (k, k) of theta.
        noise: (2 states + 1 + inputs + AIR_VARIANCES,) noise variances of states, accelerometer, equations, inputs and
            air.
        noise_known: the same of closed blocks, and last their weight, in blocks.
        informed_s: (k,) last time each derivative's regressor carried signal, s.
        changed: (k,) by which standard deviation each derivative's covariance was inflated at the last solution because
            the data contradicted it, in natural sizes; 0 where it was not.
    """

    theta: Array
    covariance: Array
    noise: Array
    noise_known: Array
    informed_s: Array
    changed: Array


class Progress(NamedTuple):
    """Which blocks have been closed, and where.

    Attributes:
        counts: (3,) solutions and closed blocks, and whether a change was found in the running one.
        condition: (4,) airspeed (m/s), altitude (m), density (kg/m3), angle of attack (rad) of the last solution.
        span: (6,) start and end of the last closed block (s), then its condition.
        scatter: (equations, 3) discounted chi-square of closed blocks, its degrees of freedom, and the dispersion
            before the last block.
        coherence: (equations, 3, bins) discounted products of residual and motion (``coherence``).
        dispersion: (equations,) what stated variances are multiplied by.
    """

    counts: NDArray[np.int64]
    condition: Array
    span: Array
    scatter: Array
    coherence: Array
    dispersion: Array


class Checkpoints(NamedTuple):
    """Copies of the running block at its last full seconds, the newest first, and what it said there.

    Attributes:
        bank, rows, sums, roughness: (checkpoints, ...) as in ``Block``, but of the rows only the last, (checkpoints,
            columns).
        gained: (checkpoints, ...) what the block had added to the memory.
    """

    bank: Array
    rows: Array
    sums: Array
    roughness: Array
    gained: Memory


class State(NamedTuple):
    """All that is remembered, of a batch of vehicles or of one of them.

    Attributes:
        filters, block, posterior, progress: of the running block and the last solution.
        memory: what closed blocks have said.
        discounted: the part of it that the time constant has discounted and that no new data have replaced yet.
        evidence: of the last closed block.
        checkpoints: of the running block.
    """

    filters: Filters
    block: Block
    posterior: Posterior
    progress: Progress
    memory: Memory
    discounted: Memory
    evidence: Evidence
    checkpoints: Checkpoints


class Linearisation(NamedTuple):
    """Where a block is linearised; in place where a solution moves it.

    Attributes:
        theta, covariance, noise, noise_known: as in ``Posterior``.
    """

    theta: Array
    covariance: Array
    noise: Array
    noise_known: Array


class Transforms(NamedTuple):
    """Fourier transforms of one block.

    Attributes:
        lines: (channels, 2, bins) of signals that are lines between samples (``bank.block_transforms``).
        regressors: (channels, 2, bins) of signals that move between samples as the aircraft does; then what acts.
        without_errors: (channels, 2, bins) the same without what the residual shows of their errors.
        rates, missed: (states + inputs, 2, bins) rates, and what lines miss (``between``).
        phase: (2, bins) e^{sT}.
        product: (2, bins) workspace.
        response: (rows, 2, bins) left sides of the equations, then the residual.
        whitened: (rows, 2, bins) W times the residual.
        residual: (rows, 2, bins) where the block is linearised.
    """

    lines: Array
    regressors: Array
    without_errors: Array
    rates: Array
    missed: Array
    phase: Array
    product: Array
    response: Array
    whitened: Array
    residual: Array


class Equation(NamedTuple):
    """Estimating equation of one block, the nuisance columns eliminated, in referred derivatives.

    Attributes:
        power: (k, k) M, power of the regressors.
        noise: (k, k) N, what of it is noise.
        vector: (k,) score at the linearisation.
        expected: (k,) part of it that is expected of sensors and air, in present derivatives.
        bias: (k,) part of it that is expected of moments which the equations leave out.
    """

    power: Array
    noise: Array
    vector: Array
    expected: Array
    bias: Array


class BlockSolution(NamedTuple):
    """What a block says.

    Attributes:
        gained: what it adds to the memory.
        evidence: what it says alone.
        noise: variances that its residual shows, as ``Posterior.noise``.
        likelihood: (1,) logarithm of the block's likelihood at the derivatives and variances of its last step.
    """

    gained: Memory
    evidence: Evidence
    noise: Array
    likelihood: Array
