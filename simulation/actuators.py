"""Surface actuators: first order with rate and position limits, dead band, play, offset and jams, compiled.

A command moves the servo, the servo the surface:

- the command plus the surface's offset, cut to the position limit, is the servo's target;
- the servo answers what exceeds half its dead band: e = target - x less that half, no answer within it;
- dx/dt = bandwidth e, its size at most the rate limit, in closed form;
- the surface follows the servo with play: it stays where it is while the servo is within half the play's width;
- a stuck surface leaves its servo and moves to where it sticks at the rate limit, or stays where it is.
"""

import math

from wingwatch.kernels.decorators import helper
from wingwatch.simulation.layout import (
    ELEVATOR_BACKLASH,
    ELEVATOR_BANDWIDTH,
    ELEVATOR_DEAD_BAND,
    ELEVATOR_LIMIT,
    ELEVATOR_OFFSET,
    ELEVATOR_RATE_LIMIT,
    ELEVATOR_STUCK,
    ELEVATOR_STUCK_AT,
)
from wingwatch.simulation.rigid_body import ELEVATOR

__all__ = ["actuator_position", "held", "move_surfaces", "servo_decay"]


@helper
def held(value, limit):  # type: ignore[no-untyped-def]
    """The value within minus and plus a limit."""
    return min(limit, max(-limit, value))


@helper
def actuator_position(position, target, bandwidth, rate_limit, after_s):  # type: ignore[no-untyped-def]
    """Where a servo is some time after it stood at ``position``, its target held since.

    dx/dt = bandwidth (target - x), its size at most ``rate_limit``: at the limit while the error is larger than
    rate_limit / bandwidth, exponential from there.

    Args:
        position: rad, at the start.
        target: rad.
        bandwidth: rad/s; infinite for a servo that follows at once (within its rate limit).
        rate_limit: rad/s, may be infinite.
        after_s: s, not negative.
    """
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


@helper
def servo_decay(c, half_step_s, decay):  # type: ignore[no-untyped-def]
    """What is left of each servo's error after half a step, into ``decay`` (3,); ``c`` is a parameter row."""
    for j in range(3):
        decay[j] = math.exp(-c[ELEVATOR_BANDWIDTH + j] * half_step_s)


@helper
def _answered(position, target, dead_band):  # type: ignore[no-untyped-def]
    """Where a servo with a dead band (full width) goes towards a target."""
    error = target - position
    return position + math.copysign(max(0.0, abs(error) - 0.5 * dead_band), error)


@helper
def move_surfaces(c, s, servo, surface, command, decay, half_step_s):  # type: ignore[no-untyped-def]
    """Surfaces at the start, middle and end of a step into ``s`` (``rigid_body.SETTING``); servos and surfaces advance.

    Args:
        c: parameter row.
        s: setting.
        servo, surface: positions at the start (3,), advanced.
        command: (3,), held over the step.
        decay: of ``servo_decay``.
        half_step_s: s.
    """
    for j in range(3):
        rate_limit = c[ELEVATOR_RATE_LIMIT + j]
        if c[ELEVATOR_STUCK + j] > 0.0:
            place = c[ELEVATOR_STUCK_AT + j]
            for stage in range(3):
                if stage > 0 and not math.isnan(place):
                    surface[j] = actuator_position(surface[j], place, math.inf, rate_limit, half_step_s)
                s[ELEVATOR + 3 * stage + j] = surface[j]
            continue
        bandwidth, play = c[ELEVATOR_BANDWIDTH + j], 0.5 * c[ELEVATOR_BACKLASH + j]
        start = servo[j]
        demanded = held(command[j] + c[ELEVATOR_OFFSET + j], c[ELEVATOR_LIMIT + j])
        target = (
            _answered(start, demanded, c[ELEVATOR_DEAD_BAND + j])
            if c[ELEVATOR_DEAD_BAND + j] > 0.0
            else demanded
        )
        quick = not math.isinf(bandwidth) and abs(target - start) * bandwidth <= rate_limit
        at = start
        for stage in range(3):
            if quick:
                at = target - (target - at) * decay[j] if stage > 0 else start
            else:
                at = actuator_position(start, target, bandwidth, rate_limit, stage * half_step_s)
            surface[j] = min(at + play, max(at - play, surface[j]))
            s[ELEVATOR + 3 * stage + j] = surface[j]
        servo[j] = at
