"""What a vane ahead of the centre of gravity would read there, compiled.

A vane l ahead meets the air l / V earlier than the centre of gravity does. The motion of the aircraft it feels at once.
So the velocity through the air less that by inertial motion, which is the air's alone, is delayed by l / V (whole
samples, and an all-pass of first order for the rest, whose group delay at low frequency is the part of a sample that is
left: Thiran 1971). An all-pass keeps the vane's noise white. Derivation: ``docs/methods/signals.md``.
"""

import numpy as np

from wingwatch.kernels.decorators import whole
from wingwatch.telemetry import MAX_GAP_S

__all__ = ["VANE_MEMORY", "meet_at_centre"]

_TIME, _RATE, _MOTION, _DELAYED, _AT, _FILLED = range(6)
_RING = 64
"""Samples that are kept: the longest delay."""
VANE_MEMORY = 6 + _RING
"""Of a vehicle: last time, rate of the velocity by inertial motion and its integral, what has passed the delay, where
in the ring the last sample is, whether the ring is filled; then the ring."""


@whole
def meet_at_centre(signals, lanes, lead_m, accelerometer, kinematic, memory):  # type: ignore[no-untyped-def]
    """Into the first state of ``signals`` (vehicles, samples, columns) what a vane at the centre of gravity would read.

    Rows without a vane or without an accelerometer stay as they are: the two motions cannot be separated.

    Args:
        signals: in place.
        lanes: ``Lanes`` of these vehicles.
        lead_m: of the vane.
        accelerometer, kinematic: columns; airspeed and whether there is a vane follow the second by 2 and 6.
        memory: (n, VANE_MEMORY), in place.
    """
    for m in range(lanes.place.size):
        own = memory[lanes.place[m]]
        ring = own[_FILLED + 1 :]
        for k in range(lanes.counts[m]):
            row = signals[m, k]
            rate, dt = row[accelerometer] + row[kinematic], row[0] - own[_TIME]
            if 0.0 < dt <= MAX_GAP_S and np.isfinite(rate) and np.isfinite(own[_RATE]):
                own[_MOTION] += 0.5 * dt * (rate + own[_RATE])
            else:
                own[_MOTION] = own[_FILLED] = 0.0
            own[_TIME], own[_RATE] = row[0], rate
            measured = row[kinematic + 6] == 1.0 and np.isfinite(row[1]) and row[kinematic + 2] > 0.0
            if own[_FILLED] == 0.0:
                if measured:
                    ring[:] = own[_DELAYED] = row[1] - own[_MOTION]
                    own[_FILLED], own[_AT] = 1.0, 0.0
                continue
            at = int(own[_AT])
            air = row[1] - own[_MOTION] if measured else ring[at]
            at = (at + 1) % _RING
            own[_AT], ring[at] = at, air
            if measured:
                steps = min(lead_m / (row[kinematic + 2] * dt), _RING - 2.0)
                whole_steps = max(int(steps - 0.5), 0)
                pole = (1.0 - steps + whole_steps) / (1.0 + steps - whole_steps)
                newer, older = ring[at - whole_steps], ring[at - whole_steps - 1]
                own[_DELAYED] = pole * (newer - own[_DELAYED]) + older
                row[1] = own[_DELAYED] + own[_MOTION]
