"""Inputs for identification: what to fly, what it promises, what limits it.

Example:
    A 3-2-1-1 for the short period, its steps and the standard error that it promises for m_q:

    >>> import math
    >>> from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, analysis_band_hz
    >>> from wingwatch.aircraft import linearised_derivatives, load_aircraft, trimmed
    >>> from wingwatch.input_design import design_input, promise, sensed_plant, surface_targets
    >>> aerosonde = load_aircraft("aerosonde")
    >>> cruise = trimmed(aerosonde, FlightCondition(25.0, 1000.0))
    >>> expected = linearised_derivatives(aerosonde, cruise, SHORT_PERIOD)
    >>> targets = surface_targets(SHORT_PERIOD, expected, analysis_band_hz(aerosonde, SHORT_PERIOD), math.radians(2.0))
    >>> design = design_input("3211", targets, 10.0, 50.0)
    >>> design.widths_s
    (0.16,)
    >>> predicted = promise(sensed_plant(aerosonde, SHORT_PERIOD, cruise, expected), design.inputs_rad, 50.0)
    >>> round(float(predicted.standard_error[SHORT_PERIOD.derivatives.index("m_q")]), 3)
    0.085
"""

from wingwatch.input_design.design import (
    INPUT_KINDS,
    SPIRAL_BANK_RAD,
    InputDesign,
    SurfaceTarget,
    design_input,
    surface_targets,
)
from wingwatch.input_design.limits import input_notes
from wingwatch.input_design.promise import (
    ModeResponse,
    Promise,
    SensedPlant,
    promise,
    sensed_plant,
)

__all__ = [
    "INPUT_KINDS",
    "SPIRAL_BANK_RAD",
    "InputDesign",
    "ModeResponse",
    "Promise",
    "SensedPlant",
    "SurfaceTarget",
    "design_input",
    "input_notes",
    "promise",
    "sensed_plant",
    "surface_targets",
]
