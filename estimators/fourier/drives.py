"""What drives the states beside the surfaces, and the motion that it causes; compiled.

Drives, in this order: rolling air, what each equation leaves out, the gust. Derivation and equation numbers:
``docs/methods/fourier.md`` sections 2 and 3.
"""

from wingwatch.estimators.fourier.noise import DRIVING
from wingwatch.estimators.fourier.state import GUST, ROLLING
from wingwatch.estimators.kernels.hot import lean

__all__ = ["ROLL", "driven_motion", "entry_of", "place_of", "roll_at_ends", "variance_of"]

ROLL = 0
"""Place of rolling air among the drives; the gust is the last."""


@lean
def variance_of(noise, e, ns, rows):  # type: ignore[no-untyped-def]
    """Variance of drive e where no sensor measures it; else 0."""
    if e == ROLL:
        return noise[ROLLING] if ns == 3 else 0.0
    if e <= ns:
        return noise[ns + e]
    return noise[GUST] if rows == ns else 0.0


@lean
def place_of(e, ns):  # type: ignore[no-untyped-def]
    """Column of ``NoiseWorkspace.answers`` with the motion by drive e."""
    if e == ROLL:
        return ns + 1
    return ns + DRIVING + e - 1 if e <= ns else ns


@lean
def entry_of(work, e, k, f):  # type: ignore[no-untyped-def]
    """How drive e enters row k, (docs (8), (9))."""
    ns, sources = work.sums.shape[0], work.transfer.shape[0]
    if 0 < e <= ns:
        return complex(1.0 if k == e - 1 else 0.0, 0.0)
    column = work.transfer[sources - 2 if e == ROLL else sources - 3, k]
    return complex(column[0, f], column[1, f])


@lean
def roll_at_ends(plant, air, work):  # type: ignore[no-untyped-def]
    """Into ``work.at_ends`` what the roll rate of the air at a block's ends and the states there have in common,
    (docs (15)): it is a first-order lag of white noise, so at the beginning it goes with the states."""
    ns = plant.lever.size
    answers = work.answers
    work.at_ends[:] = 0.0
    if air.roll_s == 0.0 or ns != 3:
        return
    _open_loop(plant, 1.0 / air.roll_s + 0.0j, answers)
    for k in range(ns):
        for j in range(ns, answers.shape[1]):
            answers[k, j] = 0.0
        answers[k, ns] = -plant.roll_column[k]
    _eliminate_states(answers, ns)
    for k in range(ns):
        work.at_ends[k] = answers[k, ns].real


@lean
def _open_loop(plant, s, answers):  # type: ignore[no-untyped-def]
    """s - A into the first columns."""
    ns = plant.lever.size
    for k in range(ns):
        for j in range(ns):
            answers[k, j] = -plant.derivatives[k, j] - (plant.forward_speed[j] if k == 0 else 0.0)
        answers[k, k] += s


@lean
def driven_motion(omega, plant, work, f):  # type: ignore[no-untyped-def]
    """Into ``work.answers`` what air and moments of unit strength drive the states to: (s - A)^-1 times each."""
    ns, nd = plant.derivatives.shape
    transfer, answers = work.transfer, work.answers
    rows = work.weights.shape[0]
    _open_loop(plant, 1j * omega[f], answers)
    for k in range(ns):
        for j in range(ns):
            answers[k, ns + DRIVING + j] = 1.0 if k == j else 0.0
        for e in range(DRIVING):
            drive = transfer[nd + 1 + e, k]
            answers[k, ns + e] = complex(drive[0, f], drive[1, f])
            if k == 0 and rows > ns:
                # The rate of the velocity is the force row and the kinematic row together.
                kinematic = transfer[nd + 1 + e, ns]
                answers[k, ns + e] += complex(kinematic[0, f], kinematic[1, f])
    _eliminate_states(answers, ns)


@lean
def _eliminate_states(rows, n):  # type: ignore[no-untyped-def]
    """Solve the complex system in the first n columns of ``rows`` for the others, in place.

    s - A has a pivot in every row: it is no eigenvalue of a part of A, none of which has no damping.
    """
    for a in range(n):
        over = 1.0 / rows[a, a]
        for c in range(rows.shape[1]):
            rows[a, c] *= over
        for b in range(n):
            if b != a:
                factor = rows[b, a]
                for c in range(rows.shape[1]):
                    rows[b, c] -= factor * rows[a, c]
