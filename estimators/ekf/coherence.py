"""How much of the innovations goes with the motion of the half second before; compiled.

An innovation has nothing in common with anything before it, in gusts and in a closed loop too, as long as the model
holds. What the model leaves out comes back with every manoeuvre: stated errors are wider by as much. Derivation:
``docs/methods/kalman_filter.md``.
"""

import numpy as np

from wingwatch.estimators.ekf.state import Coherence, EkfState
from wingwatch.estimators.evidence.dispersion import coherent_dispersion
from wingwatch.kernels.decorators import helper, hot, whole

__all__ = [
    "coherent_dispersions",
    "follow_coherence",
    "follow_coherence_inline",
    "forget_coherence",
    "forget_motion",
    "no_coherence",
]

STAGES, STAGE_S = 8, 0.06
"""Low-pass filters in a row, each of this time constant: the motion of up to half a second ago, within which what a
model of two or three states leaves out (servos, sensors, the flow) has its effect."""

LEVEL_S = 5.0
"""Time over which the mean of the explained acceleration is taken, which is trim and not motion."""


@whole
def follow_coherence(model, coherence, i, z, step, gains):  # type: ignore[no-untyped-def]
    """``follow_coherence_inline`` for the engine "filterpy"."""
    follow_coherence_inline(model, coherence, i, z, step, gains)


@hot
def follow_coherence_inline(model, coherence, i, z, step, gains):  # type: ignore[no-untyped-def]
    """One sample of vehicle i: its innovations with the motion before it; then the motion goes on, (docs (15b)).

    The innovation of an equation is that of its own rate, of the force equation that of the accelerometer, or of the
    velocity where none is used.

    Args:
        model: of the filter.
        coherence: ``Coherence``, advanced; i: the vehicle.
        z: (nz,) after the sample.
        step: of the sample; gains: its ``Gains``.
    """
    ns, columns, first = model.sizes.states, model.sizes.states + model.sizes.inputs, model.sizes.dynamic
    keep = np.exp(-step.dt_s / model.memory_s)
    toward, level_toward = 1.0 - np.exp(-step.dt_s / STAGE_S), 1.0 - np.exp(-step.dt_s / LEVEL_S)
    for k in range(ns):
        passed, sums, products = coherence.passed[i, k], coherence.sums[i, k], coherence.products[i, k]
        channel = ns if k == 0 and model.use_accelerometer else k
        if gains.inverse_std[channel] > 0.0:
            innovation = gains.innovation[channel]
            for j in range(STAGES):
                sums[j] = keep * sums[j] + innovation * passed[j]
                for m in range(j + 1):
                    products[j, m] = keep * keep * products[j, m] + passed[j] * passed[m]
        explained = 0.0
        for c in range(columns):
            moved = z[c] if c < ns else step.inputs_end[c - ns]
            explained += z[first + k * columns + c] * step.scale[k * columns + c] * moved
        if not np.isfinite(coherence.level[i, k]):
            coherence.level[i, k] = explained
        coherence.level[i, k] += level_toward * (explained - coherence.level[i, k])
        newest = explained - coherence.level[i, k]
        passed[0] = newest
        for j in range(1, STAGES):
            passed[j] += toward * (passed[j - 1] - passed[j])


@hot
def forget_motion(coherence, i):  # type: ignore[no-untyped-def]
    """Of vehicle i's motion nothing is known any more: a gap."""
    coherence.level[i] = np.nan
    coherence.passed[i] = 0.0


@helper
def coherent_dispersions(coherence, i, out):  # type: ignore[no-untyped-def]
    """Into ``out`` (ns,) by equation: power of the sums over that which white innovations give them, at least one,
    (docs (15c))."""
    for k in range(out.size):
        sums, products = coherence.sums[i, k], coherence.products[i, k]
        found = expected = squares = 0.0
        for j in range(sums.size):
            found += sums[j] * sums[j]
            expected += products[j, j]
            squares += products[j, j] * products[j, j]
            for m in range(j):
                squares += 2.0 * products[j, m] * products[j, m]
        out[k] = 1.0
        if squares > 0.0:
            out[k] = coherent_dispersion(found, expected, expected * expected / squares, 0.0)


def no_coherence(vehicles: int, ns: int) -> Coherence:
    """Before the first sample."""
    stages = (vehicles, ns, STAGES)
    level = np.full((vehicles, ns), np.nan)
    return Coherence(level, np.zeros(stages), np.zeros(stages), np.zeros((*stages, STAGES)))


def forget_coherence(state: EkfState, i: int) -> None:
    """Vehicle i's derivatives have changed: what went with the motion before may have been that."""
    state.coherence.sums[i] = 0.0
    state.coherence.products[i] = 0.0
    state.scatter.coherent[i] = 1.0
