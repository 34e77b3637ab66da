"""Discrete gusts of MIL-F-8785C (section 3.7.1.3): one component of the air's motion, by the distance flown into it.

The field is frozen and crossed at one airspeed V, so the distance is V (t - start). Its gradient along the path turns
the aircraft as that of turbulence does (``wingwatch.simulation.turbulence``): q = -w'/V, r = +v'/V, at a point, not
smoothed over the span: a gust shorter than some spans turns an aircraft less than it does here. A step's gradient is
not counted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper

__all__ = ["GUST_COLUMNS", "DiscreteGust", "add_discrete_gusts", "gust_rows"]

GustAxis = Literal["u", "v", "w"]
GustShape = Literal["rise", "pulse", "step"]
AXES: tuple[str, ...] = get_args(GustAxis)
SHAPES: tuple[str, ...] = get_args(GustShape)


@dataclass(frozen=True, slots=True)
class DiscreteGust:
    """A gust that the flight meets once.

    Attributes:
        axis: along x (u), y (v) or z (w) body; positive is air that moves forward, right or down.
        amplitude_m_s: at its largest, of either sign.
        length_m: d_m, over which it grows; it matters not to a step.
        start_s: when the aircraft reaches it.
        shape: "rise": amplitude / 2 (1 - cos(pi x / d_m)) over 0 to d_m, from there on the amplitude (MIL-F-8785C);
            "pulse": the same and back to nothing at 2 d_m, the gust of the airworthiness codes with their gradient
            distance H = d_m (CS-25.341); "step": the amplitude at once.

    Raises:
        ValueError: an axis or shape that is not known, or a number outside its range.
    """

    axis: GustAxis
    amplitude_m_s: float
    length_m: float
    start_s: float
    shape: GustShape = "rise"

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise ValueError(f"a gust along {self.axis!r} cannot be simulated; give one of {', '.join(AXES)}")
        if self.shape not in SHAPES:
            raise ValueError(f"a gust has shape {self.shape!r}; give one of {', '.join(SHAPES)}")
        if not math.isfinite(self.amplitude_m_s):
            raise ValueError(f"a gust has amplitude {self.amplitude_m_s} m/s; give a finite number of m/s")
        if not (math.isfinite(self.length_m) and self.length_m > 0.0):
            raise ValueError(f"a gust grows over {self.length_m} m; give a positive length in m")
        if not (math.isfinite(self.start_s) and self.start_s >= 0.0):
            raise ValueError(f"a gust starts at {self.start_s} s; give a number of seconds from 0")


GUST_COLUMNS = 6
"""Axis, amplitude (m/s), start (s), time of growth (s, 0 for a step), whether it ends, 1/V (s/m)."""


def gust_rows(gusts: Sequence[DiscreteGust], airspeed_true_m_s: float) -> NDArray[np.float64]:
    """Gusts crossed at an airspeed, as ``add_discrete_gusts`` reads them, shape (gusts, GUST_COLUMNS)."""
    v = airspeed_true_m_s
    rows = [
        (
            AXES.index(g.axis), g.amplitude_m_s, g.start_s, 0.0 if g.shape == "step" else g.length_m / v,
            float(g.shape == "pulse"), 1.0 / v,
        )
        for g in gusts
    ]  # fmt: skip
    return np.array(rows, dtype=np.float64).reshape(len(rows), GUST_COLUMNS)


@helper
def add_discrete_gusts(rows, count, time_s, out):  # type: ignore[no-untyped-def]
    """Add the motion of the air (u, v, w, p, q, r), body axes, to ``out`` (6,); the first ``count`` rows are gusts."""
    for i in range(count):
        since = time_s - rows[i, 2]
        growth = rows[i, 3]
        ends = rows[i, 4] != 0.0
        if since < 0.0 or (ends and since >= 2.0 * growth):
            continue
        axis, amplitude = int(rows[i, 0]), rows[i, 1]
        if since >= growth and not ends:
            out[axis] += amplitude
            continue
        phase = math.pi * since / growth
        out[axis] += 0.5 * amplitude * (1.0 - math.cos(phase))
        rate = 0.5 * amplitude * math.pi / growth * math.sin(phase) * rows[i, 5]
        if axis == 2:
            out[4] -= rate
        elif axis == 1:
            out[5] += rate
