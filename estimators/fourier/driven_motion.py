"""The motion that air and moments cause, beside that of the surfaces; compiled.

Derivation and equation numbers: ``docs/methods/fourier.md`` sections 2 and 3. Memory is that of ``noise``.
"""

from wingwatch.estimators.fourier.noise import DRIVING
from wingwatch.estimators.kernels.hot import lean

__all__ = ["driven_motions", "roll_shared_at_ends"]


@lean
def driven_motions(omega, plant, work):  # type: ignore[no-untyped-def]
    """Into ``work.answers`` what air and moments of unit strength drive the states to: (s - A)^-1 times each.

    Columns after those of the states: gust, rolling air, the moment left out of each equation. The transfer of the air
    has to be that of ``weigh``.
    """
    ns, nd = plant.derivatives.shape
    transfer = work.transfer
    rows = work.weights.shape[0]
    for f in range(omega.size):
        answers = work.answers[f]
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
def roll_shared_at_ends(plant, air, work):  # type: ignore[no-untyped-def]
    """Into ``work.at_ends`` 2 c(1/tau) of (docs (14c)).

    The air's roll rate is a first-order lag of white noise, so what it is at the beginning of a block goes with the
    states there.
    """
    ns = plant.lever.size
    begun = work.begun
    work.at_ends[:] = 0.0
    if ns != 3 or air.roll_s == 0.0:
        return
    _open_loop(plant, 1.0 / air.roll_s + 0.0j, begun)
    for k in range(ns):
        begun[k, ns] = -plant.roll_column[k]
    _eliminate_states(begun, ns)
    for k in range(ns):
        work.at_ends[k] = begun[k, ns].real


@lean
def _open_loop(plant, s, answers):  # type: ignore[no-untyped-def]
    """s - A into the first columns."""
    ns = plant.lever.size
    for k in range(ns):
        for j in range(ns):
            answers[k, j] = -plant.derivatives[k, j] - (plant.forward_speed[j] if k == 0 else 0.0)
        answers[k, k] += s


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
