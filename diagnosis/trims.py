"""What steady forces and moments a window lacks: measured accelerations less the simulation's, on average."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.diagnosis.candidate import INDEX
from wingwatch.diagnosis.measured import MeasuredFlight, Window, finite_mean
from wingwatch.diagnosis.replay import TRIMS, Inputs, body_state, measured_start
from wingwatch.simulation.dynamics import derivatives

__all__ = ["measured_trims"]

Array = NDArray[np.float64]

_POINTS = 16


def measured_trims(flight: MeasuredFlight, window: Window, row: Array, inputs: Inputs) -> Array:
    """``TRIMS`` that make mean forces and moments those that were measured, (6,)."""
    starts = np.linspace(window.start, window.stop - 6, _POINTS).round().astype(int)
    return finite_mean(np.array([_lacking(flight, int(k), window, row, inputs) for k in starts]))


def _lacking(flight: MeasuredFlight, k: int, window: Window, row: Array, inputs: Inputs) -> Array:
    """``TRIMS`` that are lacking about one sample, (6,)."""
    state = measured_start(flight, Window(k, k + 6), row)
    at = min(k - window.start, len(inputs.flown) - 1)
    surfaces = np.where(np.isfinite(inputs.flown[at]), inputs.flown[at], inputs.commands[at])
    rates, force = np.empty(13), np.empty(3)
    derivatives(body_state(state, inputs.altitude), surfaces, float(inputs.throttle[at]), row, force, rates)
    ahead = flight.outputs[k : k + 6]
    turning = (ahead[-1, 1:4] - ahead[0, 1:4]) / (5.0 * flight.dt_s) - rates[10:13]
    pushed = ahead[:, 4:7].mean(axis=0) - force
    pressure_area = 0.5 * inputs.density * float(state[:3] @ state[:3]) * row[INDEX["area_m2"]]
    _, fy, fz = pushed * row[INDEX["mass_kg"]] / pressure_area
    inertia = np.array([row[INDEX[f"inertia_{axis}"]] for axis in "xyz"])
    lengths = np.array([row[INDEX["span_m"]], row[INDEX["chord_m"]], row[INDEX["span_m"]]])
    roll, pitch, yaw = turning * inertia / (pressure_area * lengths)
    found = {"CL_zero": -fz, "CY_zero": fy, "Cl_zero": roll, "Cm_zero": pitch, "Cn_zero": yaw}
    return np.array([*(found[name] for name in TRIMS[:5]), pushed[0] / GRAVITY_M_S2])
