"""What an input does between two readings; compiled."""

import numpy as np

from wingwatch.estimators.kernels.hot import hot

__all__ = ["course"]


@hot
def course(dt, servo_s, at_rest):  # type: ignore[no-untyped-def]
    """How an input goes from one reading to the next, as f(t/dt) from 0 to 1: mean of f, and mean of (1/2 - t/dt) f.

    ``servo_s``: time constant of a servo whose command is held over the step, f = (1 - exp(-t/servo_s)) over its
    value at dt; infinite for one that is not known, f = t/dt, but for one that was at rest and has left it; 0 for a
    command, held to the step's end.
    """
    if servo_s == 0.0:
        return 0.0, 0.0
    ratio = dt / servo_s
    if ratio < 1e-3:
        return (0.0, 0.0) if at_rest else (0.5, -1.0 / 12.0)
    risen = 1.0 - np.exp(-ratio)
    mean = 1.0 / risen - 1.0 / ratio
    return mean, (0.5 - 1.0 / ratio + risen / (ratio * ratio)) / risen - 0.5 * mean
