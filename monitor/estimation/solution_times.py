"""When a chain solves: on a grid of half seconds of the samples' own stamps, however they are cut into messages."""

import math

from wingwatch.kernels.decorators import compiled

__all__ = ["LEAST_ROWS", "SOLUTION_INTERVAL_S", "find_due"]

SOLUTION_INTERVAL_S = 0.5
"""Thesis 9.2: least squares at 2 Hz."""

LEAST_ROWS = 5
"""Samples since the last solution, none of them half a second from the one before, without which there is none: half a
second at 10 Hz. A solution costs a thousand times what a sample does, so a message's cost goes with its samples."""

SAME_TIME_S = 1e-6
"""Stamps this close count as one: samplers round."""

LONG_STEP_S = 10.0 * SOLUTION_INTERVAL_S
"""After a longer step, or one back, the grid begins anew."""


@compiled()
def find_due(time_s, memory, found):  # type: ignore[no-untyped-def]
    """Rows after which there is a solution.

    Args:
        time_s: stamps of clean samples, (samples,).
        memory: of one vehicle, advanced in place: the last stamp, the next instant of the grid, NaN before the first,
            and the samples since the last solution or the last step too long for one.
        found: (samples,), gets the rows in order.

    Returns:
        how many they are.
    """
    number = 0
    for k in range(time_s.size):
        now_s, step = time_s[k], time_s[k] - memory[0]
        memory[0] = now_s
        if not 0.0 < step < SOLUTION_INTERVAL_S - SAME_TIME_S:  # counting begins anew
            memory[2] = 1.0
            if not 0.0 < step < LONG_STEP_S:
                memory[1] = now_s + SOLUTION_INTERVAL_S
            continue
        memory[2] += 1.0
        if now_s >= memory[1] - SAME_TIME_S and memory[2] >= LEAST_ROWS:
            found[number] = k
            number += 1
            passed = math.floor((now_s + SAME_TIME_S - memory[1]) / SOLUTION_INTERVAL_S)
            memory[1] += SOLUTION_INTERVAL_S * (1.0 + max(0.0, passed))
            memory[2] = 0.0
    return number
