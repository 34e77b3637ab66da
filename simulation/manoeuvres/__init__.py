"""Excitations added on top of what the autopilot commands; one file a manoeuvre."""

from wingwatch.simulation.manoeuvres.doublet import (
    Doublet,
    DoubletSchedule,
    doublet_pulse_s,
    doublet_schedule,
)
from wingwatch.simulation.manoeuvres.multisine import (
    Multisine,
    multisine,
    relative_peak_factor,
    schroeder_phases_rad,
)
from wingwatch.simulation.manoeuvres.rows import EXCITATION_COLUMNS, Surface, excitation, excitation_rows
from wingwatch.simulation.manoeuvres.sweep import Sweep
from wingwatch.simulation.manoeuvres.three_two_one_one import (
    ThreeTwoOneOne,
    step_3211_s,
    three_two_one_one_schedule,
)

__all__ = [
    "Doublet",
    "DoubletSchedule",
    "EXCITATION_COLUMNS",
    "Manoeuvre",
    "Multisine",
    "Surface",
    "Sweep",
    "ThreeTwoOneOne",
    "doublet_pulse_s",
    "doublet_schedule",
    "excitation",
    "excitation_rows",
    "multisine",
    "relative_peak_factor",
    "schroeder_phases_rad",
    "step_3211_s",
    "three_two_one_one_schedule",
]

Manoeuvre = Doublet | DoubletSchedule | ThreeTwoOneOne | Multisine | Sweep
