"""Excitations added on top of what the autopilot commands; one file a manoeuvre."""

from wingwatch.simulation.manoeuvres.doublet import (
    Doublet,
    DoubletSchedule,
    doublet_schedule,
)
from wingwatch.simulation.manoeuvres.multisine import (
    Multisine,
    multisine,
)
from wingwatch.simulation.manoeuvres.rows import EXCITATION_COLUMNS, Surface, excitation, excitation_rows
from wingwatch.simulation.manoeuvres.sampled import Sampled
from wingwatch.simulation.manoeuvres.sweep import Sweep
from wingwatch.simulation.manoeuvres.three_two_one_one import (
    ThreeTwoOneOne,
    three_two_one_one_schedule,
)

__all__ = [
    "Doublet",
    "DoubletSchedule",
    "EXCITATION_COLUMNS",
    "Manoeuvre",
    "Multisine",
    "Sampled",
    "Surface",
    "Sweep",
    "ThreeTwoOneOne",
    "doublet_schedule",
    "excitation",
    "excitation_rows",
    "multisine",
    "three_two_one_one_schedule",
]

Manoeuvre = Doublet | DoubletSchedule | ThreeTwoOneOne | Multisine | Sampled | Sweep
