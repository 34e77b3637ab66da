"""Kernels of the Fourier estimator with the memory that they ask of their caller, for tests of one of them at a
time."""

from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher
from numpy.typing import NDArray

from wingwatch.estimators.evidence import change
from wingwatch.estimators.evidence.forgetting import forgetting_workspace, replaced
from wingwatch.estimators.fourier import bank as transforms
from wingwatch.estimators.fourier import between, checkpoints
from wingwatch.estimators.fourier.directions import directions_workspace, reduce_information
from wingwatch.estimators.fourier.solution import zero_memory
from wingwatch.estimators.fourier.state import (
    Block,
    Checkpoints,
    Equation,
    Evidence,
    Filters,
    Memory,
    Model,
    Prior,
    Transforms,
)
from wingwatch.estimators.kernels.intersample import Servos
from wingwatch.estimators.kernels.reading_noise import READING_MEMORY

Array = NDArray[np.float64]
Real = NDArray[np.floating[Any]]

PITCH_MODEL = Model(
    omega=np.array([1.0]),
    lever=np.zeros(2),
    exponents=np.array([1.0, 1.0, 2.0]),
    servos=Servos(np.array([np.inf]), np.array([np.inf])),
    input_variance=np.zeros(1),
    prior=Prior(np.zeros(6), np.ones(6)),
    reference_airspeed_m_s=25.0,
    reference_density_kg_m3=1.225,
    block_s=10.0,
    first_solution_s=2.0,
    memory_s=40.0,
    stale_s=30.0,
    smallest_signal=0.5,
    roll_smoothing_m=0.0,
    turn_smoothing_m=0.0,
    vane_ahead_m=0.0,
    by_accelerometer=True,
    longitudinal=True,
    roll=False,
)
"""Two states and one input; tests replace what they are about."""


@cache
def in_python(kernel: Any) -> Any:
    """A kernel and all kernels that it calls, run by the interpreter.

    For arithmetic that a test does a few times: to compile a kernel by itself takes a second or more. Compiled, within
    the kernels that call it, it is tested by what the estimator says (``test_estimators_contract``).
    """
    plain = kernel.py_func
    called = {
        name: in_python(value)
        for name, value in plain.__globals__.items()
        if name in plain.__code__.co_names and isinstance(value, CPUDispatcher)
    }
    run = FunctionType(plain.__code__, plain.__globals__ | called, plain.__name__, plain.__defaults__)
    return np.errstate(all="ignore")(run)  # as in kernels


def new_filters(bins: int) -> Filters:
    """Filters before the first sample."""
    return Filters(np.zeros((8, bins)), np.full(1, -1.0), np.zeros((1, READING_MEMORY)))


def rows_before(rows: Real, k: int) -> Array:
    """``Block.rows`` before sample k of a record that began with its first row."""
    return np.stack([rows[0], rows[k - 1], rows[k - 2] if k > 1 else np.full(rows.shape[1], np.nan)])


def reduced(
    m: Real, noise: Real, score: Real, bias: Real, smallest: float
) -> tuple[list[Array], list[Array]]:
    """``reduce_information``: sensitivity, kept, evidence; then score, bias, evidence's score and bias."""
    p = len(m)
    gained, evidence = zero_memory(p), Evidence(np.empty((p, p)), np.empty(p), np.empty(p))
    equation = Equation(m, noise, score, np.zeros(p), bias)  # type: ignore[arg-type]
    in_python(reduce_information)(equation, smallest, directions_workspace(p), gained, evidence)
    matrices = [gained.sensitivity, gained.information, evidence.information]
    return matrices, [gained.vector, gained.bias, evidence.vector, evidence.bias]


def left_by(discounted: Real, known: Real, gained: Real, decay: float) -> Array:
    """``replaced``: what discounted information is multiplied by."""
    k = len(known)
    out = np.empty((k, k))
    in_python(replaced)(discounted, known, gained, decay, forgetting_workspace(k), out)
    return out


def change_of(window: Real, vector: Real, mean: Real, covariance: Real) -> tuple[Array, Array]:
    """``change.change_of``: K and r."""
    work = change.change_workspace(len(mean))
    change.change_of(window, vector, mean, covariance, work)
    return work.information, work.vector


def changed_derivatives(
    information: Array, vector: Array, size: Real, threshold: float, changed: NDArray[np.bool_]
) -> float:
    """``change.changed_derivatives`` of K and r, which are overwritten."""
    work = change.change_workspace(len(size))._replace(information=information, vector=vector)
    return float(change.changed_derivatives(size, threshold, work, changed))


def inflate_covariance(memory: Memory, size: Real) -> None:
    """``change.inflate_covariance``."""
    in_python(change.inflate_covariance)(memory, size, change.change_workspace(len(size)))


def spread_of_change(information: Array, vector: Array, size: Real, changed: NDArray[np.bool_]) -> Array:
    """``change.spread_of_change``, (k,); ``information`` and ``vector`` are overwritten."""
    work, spread = change.change_workspace(len(size)), np.empty(len(size))
    in_python(change.spread_of_change)(
        size, changed, work._replace(information=information, vector=vector), spread
    )
    return spread


def since_checkpoint(omega: Real, block: Block, checkpoint: Block) -> Block:
    """``checkpoints.since_checkpoint``, of a block as it was: the window since then."""
    k = 1
    kept = Memory(np.empty((1, k, k)), np.empty((1, k, k)), np.empty((1, k)), np.empty((1, k)))
    points = Checkpoints(
        checkpoint.bank[None], checkpoint.rows[1:2], checkpoint.sums[None], checkpoint.roughness[None], kept
    )
    window = Block(*(np.empty_like(array) for array in block))
    in_python(checkpoints.since_checkpoint)(omega, block, points, 0, window)
    return window


def transforms_of(omega: Real, bank: Real, span: float, ns: int, nu: int) -> tuple[Array, Array]:
    """``bank.block_transforms``: (channels, 2, bins), phase (2, bins); span smoothed 0.1 s."""
    out = np.empty((len(bank) + transforms.NUISANCE - 1, 2, omega.size))
    phase = np.empty((2, omega.size))
    transforms.block_transforms(omega, bank, span, 0.1, ns, nu, out, phase)
    return out, phase


def curves_of(model: Model, lines: Array, phase: Array, rows: Real, dt: float, forward: Real) -> Array:
    """``between.between_samples`` of the prior's derivatives, at the reference condition."""
    bins = model.omega.size
    none = np.empty((2, bins))
    work = Transforms(
        lines,
        np.empty(lines.shape),
        np.empty(lines.shape),
        np.empty((3, 2, bins)),
        np.empty((3, 2, bins)),
        phase,
        none,
        none[None],
        none[None],
        none[None],
    )
    ends = np.stack([rows[0], rows[-1], rows[-2]])
    between.between_samples(model, ends, dt, model.prior.value, np.ones(6), forward, work)
    return work.regressors


def as_complex(planar: Real) -> NDArray[np.complex128]:
    """(channels, 2, bins), or (2, bins), as complex (bins, channels) or (bins,)."""
    return np.asarray(np.moveaxis(planar[..., 0, :] + 1j * planar[..., 1, :], 0, -1))
