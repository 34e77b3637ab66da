"""First-order surface actuators with rate and position limits, in closed form, compiled."""

import math

from numba import njit

__all__ = ["actuator_position"]


@njit(cache=True, error_model="numpy")
def actuator_position(position, command, bandwidth, rate_limit, position_limit, after_s):  # type: ignore[no-untyped-def]
    """Where a surface is some time after it stood at ``position``, the command held since.

    dx/dt = bandwidth (command - x), its size at most ``rate_limit``: at the limit while the error is larger than
    rate_limit / bandwidth, exponential from there. The command is cut to the position limit before.

    Args:
        position: rad, at the start.
        command: rad.
        bandwidth: rad/s; infinite for a surface that follows at once (within its rate limit).
        rate_limit: rad/s, may be infinite.
        position_limit: rad, symmetric, may be infinite.
        after_s: s, not negative.
    """
    target = min(position_limit, max(-position_limit, command))
    error = target - position
    size = abs(error)
    knee = rate_limit / bandwidth if not (math.isinf(rate_limit) and math.isinf(bandwidth)) else math.inf
    left = after_s
    if size > knee:
        travel = (size - knee) / rate_limit
        if after_s < travel:
            return position + math.copysign(rate_limit * after_s, error)
        left -= travel
        size = knee
    if math.isinf(bandwidth):
        return target
    return target - math.copysign(size * math.exp(-bandwidth * left), error)
