"""Inputs for identification: what to fly, what it promises, what limits it."""

from wingwatch.input_design.design import (
    INPUT_KINDS,
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
