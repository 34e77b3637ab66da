"""The flight condition of a block: sums over its rows, and their mean; compiled."""

import math

from wingwatch.estimators.fourier.state import AIRSPEED, ALPHA, ALTITUDE, DENSITY, SAMPLES
from wingwatch.kernels.decorators import lean

__all__ = ["gather_condition", "mean_condition"]


@lean
def gather_condition(sums, row, condition):  # type: ignore[no-untyped-def]
    """Add a signal row (columns,), whose flight condition begins at column ``condition``, to its ``sums`` (5,).

    Airspeed m/s, altitude m, density kg/m3, angle of attack rad, number of samples.
    """
    alpha = row[condition + ALPHA]
    sums[AIRSPEED] += row[condition + AIRSPEED]
    sums[DENSITY] += row[condition + DENSITY]
    sums[ALTITUDE] += row[condition + ALTITUDE]
    sums[ALPHA] += alpha if math.isfinite(alpha) else 0.0
    sums[SAMPLES] += 1.0


@lean
def mean_condition(sums, condition):  # type: ignore[no-untyped-def]
    """Mean airspeed m/s, altitude m, density kg/m3, angle of attack rad, into ``condition`` (4,)."""
    condition[0], condition[1] = sums[AIRSPEED] / sums[SAMPLES], sums[ALTITUDE] / sums[SAMPLES]
    condition[2], condition[3] = sums[DENSITY] / sums[SAMPLES], sums[ALPHA] / sums[SAMPLES]
