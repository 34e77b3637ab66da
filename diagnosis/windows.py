"""A window flown by versions of the simulation: with a filter, or open loop through still air."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.innovations import Filter, Mask, Path, fly
from wingwatch.diagnosis.measured import FORCE_X, OUTPUTS
from wingwatch.diagnosis.problem import Problem, lead_of
from wingwatch.diagnosis.replay import BIAS, SCALE, Model, body_state, fly_window, sense

__all__ = ["all_seen", "fly_filtered", "open_loop", "seen_in"]

Array = NDArray[np.float64]


def open_loop(
    problem: Problem, w: int, model: Model, starts: Array, trims: Array, measured: Array | None = None
) -> Array:
    """What sensors read through still air from each start (n, 8) by each trims (n, 6), (n, samples, outputs).

    Where the force along x is given, what its accelerometer ``measured`` (samples, outputs) moves the aircraft.
    """
    window, inputs = problem.windows[w], problem.inputs[w]
    out = np.empty((len(starts), window.stop - window.start, len(OUTPUTS)))
    states = np.array([body_state(start, inputs.altitude) for start in starts])
    force_x = np.full(out.shape[1], np.nan)
    if measured is not None and problem.subject.given:
        bias, scale = model.sensors[FORCE_X, [BIAS, SCALE]]
        force_x = (measured[:, FORCE_X] - bias) / (1.0 + scale)
    fly_window(np.tile(model.row, (len(starts), 1)), states, trims, inputs, force_x, out)
    return sense(out, model)


def fly_filtered(
    problem: Problem,
    w: int,
    model: Model,
    trims: Array,
    filtering: Filter,
    measured: Array,
    *,
    air_too: bool = False,
) -> Path:
    """A window flown with its filter, by trims (6,); ``measured``: (samples, outputs) of the whole flight."""
    window, inputs = problem.windows[w], problem.inputs[w]
    readings = np.ascontiguousarray(measured[window.start : window.stop, list(problem.used)])
    start = body_state(problem.starts[w], inputs.altitude)
    return fly(
        filtering, model, start, trims, inputs, readings, seen_in(problem, w, measured), air_too=air_too
    )


def seen_in(problem: Problem, w: int, measured: Array) -> Mask:
    """Which readings of a window count, (samples, used)."""
    window = problem.windows[w]
    seen = np.isfinite(measured[window.start : window.stop, list(problem.used)])
    seen[: lead_of(problem, w), problem.subject.given :] = False
    return seen


def all_seen(problem: Problem, group: int) -> Mask:
    """Of windows of a group that miss no reading, (samples of the longest, used)."""
    alike = [w for w, g in zip(problem.windows, problem.groups, strict=True) if g == group]
    seen = np.ones((max(w.stop - w.start for w in alike), len(problem.used)), dtype=np.bool_)
    seen[: lead_of(problem, group), problem.subject.given :] = False
    return seen
