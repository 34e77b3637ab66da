"""The root of a function between two points where it has opposite signs, by Brent's method.

Without SciPy, whose optimisers take longer to load than a command to trim an aircraft.
"""

import math
from collections.abc import Callable

__all__ = ["bracketed_root"]

_MOST = 100
_XTOL = 1e-14
_RTOL = 1e-14


def bracketed_root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a continuous function crosses zero, to 1e-14 absolute and relative.

    Inverse quadratic interpolation or a secant where that shrinks the bracket fast enough, else bisection (Brent 1973,
    Algorithms for Minimization without Derivatives, chapter 4).

    Args:
        low, high: the function has opposite signs there, or is zero at one of them.

    Raises:
        ValueError: it has the same sign at both.
        ArithmeticError: it is no number on the way, or has no root to that precision after 100 steps.
    """
    before, best = low, high
    f_before, f_best = function(before), function(best)
    if f_before == 0.0:
        return before
    if f_best == 0.0:
        return best
    if (f_before < 0.0) == (f_best < 0.0):
        raise ValueError(f"the function has the same sign at {low:g} and {high:g}")
    other, f_other = before, f_before  # the end of the bracket that lies across the root from the best point
    step = last_step = best - before
    for _ in range(_MOST):
        if (f_best < 0.0) == (f_other < 0.0):
            other, f_other = before, f_before
            step = last_step = best - before
        if abs(f_other) < abs(f_best):
            before, best, other = best, other, best
            f_before, f_best, f_other = f_best, f_other, f_best
        tolerance = 0.5 * (_XTOL + _RTOL * abs(best))
        middle = 0.5 * (other - best)
        if f_best == 0.0 or abs(middle) < tolerance:
            return best
        step, last_step = _next_step(
            (before, best, other), (f_before, f_best, f_other), step, last_step, tolerance
        )
        before, f_before = best, f_best
        best += step if abs(step) > tolerance else math.copysign(tolerance, middle)
        f_best = function(best)
        if math.isnan(f_best):
            raise ArithmeticError(f"the function is no number at {best:g}")
    raise ArithmeticError(f"no root between {low:g} and {high:g} after {_MOST} steps")


def _next_step(
    points: tuple[float, float, float],
    values: tuple[float, float, float],
    step: float,
    last_step: float,
    tolerance: float,
) -> tuple[float, float]:
    """The step from the best point, and the step that the next one is measured by."""
    (before, best, other), (f_before, f_best, f_other) = points, values
    middle = 0.5 * (other - best)
    if abs(last_step) <= tolerance or abs(f_best) >= abs(f_before):
        return middle, middle
    if before == other:
        wanted = -f_best * (best - before) / (f_best - f_before)
    else:
        near, far = (f_before - f_best) / (before - best), (f_other - f_best) / (other - best)
        wanted = -f_best * (f_other * far - f_before * near) / (far * near * (f_other - f_before))
    if 2.0 * abs(wanted) < min(abs(last_step), 3.0 * abs(middle) - tolerance):
        return wanted, step
    return middle, middle
