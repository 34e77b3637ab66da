"""What ice adds to the coefficients without being proportional to them: the non-linear Twin Otter model.

Polynomials of the University of Illinois Smart Icing Systems group for the DHC-6 Twin Otter, as FlightGear's
UIUC flight model carries them (src/FDM/UIUCModel/uiuc_iced_nonlin.cpp, version 020409): differences clean less
iced, fitted at a severity of 0.08 on the wing and 0.20 on the tail, by angle of attack and elevator in degrees.
That they hold for another aircraft is an assumption.

Ours, not the source's:

- the polynomials are held at the edges of where they are used: angle of attack -5 to 16 degrees (16 is where the
  source changes to another lift polynomial; it states no lower edge) and elevator -15 to 15 degrees (it states none);
- ice on the left wing alone yaws to the left: the source's sign of the yawing moment pulls away from the wing with
  the greater drag, which no drag can do;
- the source's hinge moments are left out, for the surfaces here have actuators.
"""

import math

from wingwatch.kernels.decorators import compiled
from wingwatch.simulation.prepared import KEEP_BITS

__all__ = ["ALPHA_HIGH_DEG", "ALPHA_LOW_DEG", "ELEVATOR_DEG", "icing_increments"]

ALPHA_LOW_DEG, ALPHA_HIGH_DEG = -5.0, 16.0
ELEVATOR_DEG = 15.0

_WING, _TAIL = 0.08, 0.20
"""Severities of the fits."""
_LINEAR_UP_TO = 0.1
"""Severity from which lift is lost more slowly."""
_DEGREES = 180.0 / math.pi
_ARM = 1.0 / 8.0
"""Of a wing's lift, in spans (the source's figure)."""


@compiled(error_model="numpy", fastmath=KEEP_BITS)
def icing_increments(alpha, elevator, wing, tail, left_less_right):  # type: ignore[no-untyped-def]
    """(dCL, dCD, dCl, dCm, dCn) at an angle of attack and elevator in rad.

    Severities: of the wing (the mean of both sides), of the tail, of the left wing less that of the right.
    """
    a = min(ALPHA_HIGH_DEG, max(ALPHA_LOW_DEG, _DEGREES * alpha))
    d = min(ELEVATOR_DEG, max(-ELEVATOR_DEG, _DEGREES * elevator))
    lift = 0.088449 + a * (0.004836 + a * (-0.0005459 + a * 4.0859e-5))
    drag = -0.0089 + a * (0.001578 + a * (-0.00046253 + a * (-4.7511e-5 + a * 2.3384e-6)))
    pitch = -0.01892 + a * (-0.0056476 + a * (1.0205e-5 + a * (-4.0692e-5 + a * 1.7594e-6)))
    pitch_elevator = -0.014928 - 0.0037783 * a + d * d * (0.00039086 + d * (-1.1304e-5 + d * -1.8439e-6))
    amount = wing if wing <= _LINEAR_UP_TO else 0.3 - 0.3297 * math.exp(-5.0 * wing)
    return (
        -lift / _WING * amount,
        -drag / _WING * wing,
        -lift / _WING * left_less_right * _ARM,
        (0.75 * wing + 0.25 * tail) * pitch / _WING + tail * pitch_elevator / _TAIL,
        drag / _WING * left_less_right * _ARM,
    )
