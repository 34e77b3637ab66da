"""The motion that air and moments cause, beside that of the surfaces; compiled.

Derivation and equation numbers: ``docs/methods/fourier.md`` sections 2 and 3. Memory is that of ``noise``; real and
imaginary parts lie apart and bins side by side.
"""

from wingwatch.estimators.fourier.noise import DRIVING
from wingwatch.kernels.decorators import lean

__all__ = ["driven_motions", "roll_shared_at_ends"]


@lean
def driven_motions(omega, plant, work):  # type: ignore[no-untyped-def]
    """Into ``work.answers`` what air and moments of unit strength drive the states to: (s - A)^-1 times each.

    Columns after those of the states: gust, rolling air, the moment left out of each equation. The transfer of the air
    has to be that of ``weigh``.
    """
    ns, nd = plant.derivatives.shape
    transfer, answers = work.transfer, work.answers
    rows = work.weights.shape[0]
    _open_loop(plant, 0.0, omega, answers)
    for k in range(ns):
        for e in range(DRIVING):
            drive, out = transfer[nd + 1 + e, k], answers[k, ns + e]
            for part in range(2):
                for f in range(omega.size):
                    out[part, f] = drive[part, f]
            if k == 0 and rows > ns:
                # The rate of the velocity is the force row and the kinematic row together.
                kinematic = transfer[nd + 1 + e, ns]
                for part in range(2):
                    for f in range(omega.size):
                        out[part, f] += kinematic[part, f]
        for j in range(ns):
            answers[k, ns + DRIVING + j, 0, :] = 1.0 if k == j else 0.0
            answers[k, ns + DRIVING + j, 1, :] = 0.0
    _eliminate_states(answers, ns)


@lean
def roll_shared_at_ends(plant, air, work):  # type: ignore[no-untyped-def]
    """Into ``work.at_ends`` 2 c(1/tau) of (docs (15a)).

    The air's roll rate is a first-order lag of white noise, so what it is at the beginning of a block goes with the
    states there.
    """
    ns = plant.lever.size
    begun = work.begun
    work.at_ends[:] = 0.0
    if ns != 3 or air.roll_s == 0.0:
        return
    _open_loop(plant, 1.0 / air.roll_s, work.at_rest, begun)
    for k in range(ns):
        begun[k, ns, 0, 0], begun[k, ns, 1, 0] = -plant.roll_column[k], 0.0
    _eliminate_states(begun, ns)
    for k in range(ns):
        work.at_ends[k] = begun[k, ns, 0, 0]


@lean
def _open_loop(plant, damping, omega, answers):  # type: ignore[no-untyped-def]
    """s - A into the first columns, s = damping + i omega."""
    ns = plant.lever.size
    for k in range(ns):
        for j in range(ns):
            real, imaginary = answers[k, j, 0], answers[k, j, 1]
            own = damping if j == k else 0.0
            own -= plant.derivatives[k, j] + (plant.forward_speed[j] if k == 0 else 0.0)
            for f in range(omega.size):
                real[f], imaginary[f] = own, omega[f] if j == k else 0.0


@lean
def _eliminate_states(rows, n):  # type: ignore[no-untyped-def]
    """Solve the complex systems in the first n columns of ``rows`` (n, columns, 2, bins) for the others, in place.

    s - A has a pivot in every row: it is no eigenvalue of a part of A, none of which has no damping.
    """
    bins = rows.shape[3]
    for a in range(n):
        for c in range(a + 1, rows.shape[1]):
            x, y, u, v = rows[a, c, 0], rows[a, c, 1], rows[a, a, 0], rows[a, a, 1]
            for f in range(bins):
                size = 1.0 / (u[f] * u[f] + v[f] * v[f])
                real = (x[f] * u[f] + y[f] * v[f]) * size
                y[f] = (y[f] * u[f] - x[f] * v[f]) * size
                x[f] = real
        for b in range(n):
            if b == a:
                continue
            for c in range(a + 1, rows.shape[1]):
                p, q, x, y = rows[b, c, 0], rows[b, c, 1], rows[a, c, 0], rows[a, c, 1]
                u, v = rows[b, a, 0], rows[b, a, 1]
                for f in range(bins):
                    p[f] -= u[f] * x[f] - v[f] * y[f]
                    q[f] -= u[f] * y[f] + v[f] * x[f]
