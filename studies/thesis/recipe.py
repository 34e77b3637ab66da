"""The thesis's online estimator as it describes it (8.10 to 8.13, 9.2 to 9.5), to stand beside ours on one record.

Every second sample of 50 Hz is summed into a transform at 0.1 to 4 Hz in steps of 0.02 Hz, forgotten by a factor a
sample, after the first sample is taken off; the two equations are solved by least squares of their real parts. What the
thesis does not say is how a transform is differentiated: here by j omega, as in the work that it takes the method from
(Morelli 1999). The surface, held between samples, enters a sum of samples as the mean of what it was held at before and
after each: otherwise it would be half a sample late.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators import SignalLayout
from wingwatch.studies.thesis.records import RATE_HZ

__all__ = ["recipe_trace"]

Array = NDArray[np.float64]

_EVERY = 2
_SURFACE = SignalLayout(2, 1).first_input
_OMEGA = 2.0 * np.pi * np.arange(0.1, 4.0 + 1e-9, 0.02)
_FIRST_S = 2.0


def recipe_trace(
    rows: Array, forgetting: float, every_s: float = 0.5
) -> Iterator[tuple[float, Array, Array]]:
    """Time, derivatives (6,) and their standard errors (6,), from 2 s on.

    Args:
        rows: signal rows of one record, 50 Hz.
        forgetting: factor a sample of 25 Hz.
        every_s: between two solutions.
    """
    surface = rows[:, _SURFACE]
    held = surface.copy()
    held[1:] = 0.5 * (surface[1:] + surface[:-1])
    taken = rows[::_EVERY]
    signals = np.column_stack([taken[:, 1:3], held[::_EVERY]])
    signals = signals - signals[0]
    step_s = _EVERY / RATE_HZ
    turn = np.exp(-1j * _OMEGA * step_s)
    phase = np.ones(_OMEGA.size, dtype=complex)
    sums = np.zeros((3, _OMEGA.size), dtype=complex)
    solve_every = round(every_s / step_s)
    for k, sample in enumerate(signals):
        sums = forgetting * sums + sample[:, None] * phase
        phase = phase * turn
        if k * step_s >= _FIRST_S and (k + 1) % solve_every == 0:
            yield float(taken[k, 0]), *_solved(sums * step_s)


def _solved(transforms: NDArray[np.complex128]) -> tuple[Array, Array]:
    regressors = transforms.T
    inverse = np.linalg.inv(np.real(regressors.conj().T @ regressors))
    value, error = [], []
    for k in (0, 1):
        left = 1j * _OMEGA * transforms[k]
        theta = inverse @ np.real(regressors.conj().T @ left)
        rest = left - regressors @ theta
        variance = float(np.real(rest.conj() @ rest)) / (_OMEGA.size - theta.size)
        value.append(theta)
        error.append(np.sqrt(variance * np.diagonal(inverse)))
    return np.concatenate(value), np.concatenate(error)
