"""Noise of a surface's or a sensor's readings, learned beside its motion; compiled.

A surface moves smoothly and now and then quickly; its readings' noise is white and always there. Differences of order
n of white noise of variance R have the variance C(2n, n) R, while those of a motion slower than a quarter of the
sampling rate shrink with n. So differences of the fourth and the sixth order are followed, each by the median of their
magnitudes in logarithms, by steps of a sign.

- R4 and R6, the variances by either order, differ by motion alone. Of a motion at less than a quarter of the sampling
  rate the sixth keeps at most ``LEAK`` of what it has less than the fourth, so R is between R6 - LEAK (R4 - R6) and R6,
  but for chance. The stated variance is a measurement too, and counts by what is known of its error.
- A step of more than ``JUMP`` of their median is motion, and the differences begin anew after it.
- A reading that is repeated a few times is one of a slower sensor, and is passed over; longer, it is a surface at rest
  whose readings have no noise.
"""

import math

from wingwatch.kernels.decorators import lean

__all__ = ["READING_MEMORY", "follow_reading", "forget_readings", "largest_variance", "reading_variance"]

_LAST, _FRESH, _REPEATS, _READINGS, _COUNT, _MEDIAN, _LEVEL, _LARGEST = 0, 6, 7, 8, 9, 10, 13, 14
_FIRST, _FOURTH, _SIXTH = range(_MEDIAN, _MEDIAN + 3)
READING_MEMORY = 15
"""Numbers remembered of an input, zeros at the start: the last difference of each order from none to five, readings
since a gap or jump, how often the last was repeated, readings and whole differences seen, logarithms of the medians of
steps and of differences of the fourth and the sixth order, the variance believed and what it may be at most."""

JUMP = 4.0
"""2.7 standard deviations of a step by noise."""

LEAK = 0.4346
"""2^2 70 / 924 / (1 - 2^2 70 / 924): a motion at a quarter of the rate has differences of variance 2^n."""

_MEMORY_S = 60.0
_MOST_REPEATS = 4.0
_FEWEST = 16.0
"""Steps before the differences begin, and differences without which the stated variance is believed."""
_EVERY = 16
"""Differences after which the variance is computed anew."""
_CHANCE = 4.2
"""Relative standard error of a variance by a median, times the root of the count: 2.33, and differences go together
over 3.2 samples."""
_STATED = 0.7
"""That of a stated variance: it may be wrong by a factor of two."""
_STEP = 1.17
"""Of the logarithm, at which a median by signs is as sharp as it can be: over twice its density there, 0.43."""
_TINY = 1e-12
_LOG_JUMP = math.log(JUMP)
_LOG_NORMAL = math.log(0.6744898)
"""Of the median magnitude of a standard normal number."""
_LOG_70, _LOG_924 = math.log(70.0), math.log(924.0)


@lean
def follow_reading(memory, reading, dt, stated):  # type: ignore[no-untyped-def]
    """One reading more.

    Args:
        memory: (READING_MEMORY,) of this input, advanced.
        reading: of the input, rad.
        dt: time since the last one, s.
        stated: variance as it is stated, rad2; 0: the input is exact, and nothing is learned.
    """
    if stated == 0.0:
        return
    repeated = memory[_FRESH] > 0.0 and reading == memory[_LAST]
    memory[_REPEATS] = memory[_REPEATS] + 1.0 if repeated else 0.0
    if repeated and memory[_REPEATS] <= _MOST_REPEATS:
        return
    step = fourth = 0.0
    difference = reading
    for order in range(6):
        before = memory[_LAST + order]
        memory[_LAST + order] = difference
        difference -= before
        if order == 0:
            step = difference
        elif order == 3:
            fourth = difference
    memory[_FRESH] += 1.0
    if memory[_FRESH] == 1.0:
        return
    memory[_READINGS] += 1.0
    log = math.log(max(abs(step), _TINY))
    if memory[_READINGS] > _FEWEST and log > memory[_FIRST] + _LOG_JUMP:
        memory[_FRESH] = 1.0
    _follow_median(memory, _FIRST, log, memory[_READINGS], dt)
    if memory[_FRESH] <= 6.0 or memory[_READINGS] <= _FEWEST:
        return
    memory[_COUNT] += 1.0
    _follow_median(memory, _FOURTH, math.log(max(abs(fourth), _TINY)), memory[_COUNT], dt)
    _follow_median(memory, _SIXTH, math.log(max(abs(difference), _TINY)), memory[_COUNT], dt)
    if memory[_COUNT] >= _FEWEST and memory[_COUNT] % _EVERY == 0.0:
        _believe(memory, max(dt / _MEMORY_S, 1.0 / memory[_COUNT]), stated)


@lean
def reading_variance(memory, stated):  # type: ignore[no-untyped-def]
    """Variance of an input's readings as it is believed now, a scalar in rad2; ``memory``: one row of the state."""
    return memory[_LEVEL] if memory[_COUNT] >= _FEWEST else stated


@lean
def largest_variance(memory, stated):  # type: ignore[no-untyped-def]
    """The stated variance, or the largest that the readings allow where that is more, a scalar in rad2."""
    return max(stated, memory[_LARGEST]) if memory[_COUNT] >= _FEWEST else stated


@lean
def forget_readings(memory):  # type: ignore[no-untyped-def]
    """After a gap: differences begin anew, what is known of the noise stays."""
    memory[_FRESH] = memory[_REPEATS] = 0.0


@lean
def _follow_median(memory, which, log, count, dt):  # type: ignore[no-untyped-def]
    """The logarithm of one magnitude more, the ``count``-th."""
    if count == 1.0:
        memory[which] = log
    else:
        memory[which] += _STEP * max(dt / _MEMORY_S, 1.0 / count) * (1.0 if log > memory[which] else -1.0)


@lean
def _believe(memory, weight, stated):  # type: ignore[no-untyped-def]
    """Within the limits that the differences set the value nearest to the stated one, and from there on towards the
    stated one by what chance and it know, both as errors of a logarithm; and two standard errors more."""
    fourth = math.exp(2.0 * (memory[_FOURTH] - _LOG_NORMAL) - _LOG_70)
    sixth = math.exp(2.0 * (memory[_SIXTH] - _LOG_NORMAL) - _LOG_924)
    found = min(max(stated, sixth - LEAK * max(fourth - sixth, 0.0)), sixth)
    chance = _CHANCE * _CHANCE * weight
    memory[_LEVEL] = found * (stated / found) ** (chance / (chance + _STATED * _STATED))
    memory[_LARGEST] = sixth * math.exp(2.0 * math.sqrt(chance))
