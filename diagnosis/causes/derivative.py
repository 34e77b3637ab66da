"""A single coefficient that is wrong, by the concise name of its derivative; constants by their own."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject
from wingwatch.diagnosis.coefficients import with_added
from wingwatch.diagnosis.replay import Model

__all__ = ["COEFFICIENT", "candidates"]

COEFFICIENT = {
    "z_w": "CL_alpha", "z_q": "CL_q", "z_eta": "CL_elevator",
    "m_w": "Cm_alpha", "m_eta": "Cm_elevator",
    "y_v": "CY_beta", "y_p": "CY_p", "y_r": "CY_r", "y_xi": "CY_aileron", "y_zeta": "CY_rudder",
    "l_v": "Cl_beta", "l_p": "Cl_p", "l_r": "Cl_r", "l_xi": "Cl_aileron", "l_zeta": "Cl_rudder",
    "n_v": "Cn_beta", "n_p": "Cn_p", "n_r": "Cn_r", "n_xi": "Cn_aileron", "n_zeta": "Cn_rudder",
}  # fmt: skip
"""Coefficient behind a concise derivative; m_q is ``pitch_damping``."""

_CONSTANTS = {
    "CL_zero": 0.02,
    "Cm_zero": 0.005,
    "CD_min": 0.003,
    "CY_zero": 0.003,
    "Cl_zero": 0.001,
    "Cn_zero": 0.001,
}
"""Constants of steady flight, and the least error of each that matters."""

_SMALL = {"CL": 0.2, "CY": 0.05, "Cl": 0.02, "Cm": 0.1, "Cn": 0.02}
"""Size of a coefficient of which the file says 0, about that of a small term."""


def candidates(subject: Subject) -> list[Candidate]:
    """Every one; constants where the simulation states them."""
    found = [_one(symbol, name, subject) for symbol, name in COEFFICIENT.items()]
    if subject.trims_known:
        found += [
            _constant(name, least)
            for name, least in _CONSTANTS.items()
            if name != "CD_min" or subject.throttle_known
        ]
    return found


def _one(symbol: str, name: str, subject: Subject) -> Candidate:
    stated = float(subject.model.row[INDEX[name]])
    size = stated or _SMALL[name[:2]]
    parameter = FreeParameter("change", "" if stated else name, 0.02, 0.3, 0.03, -10.0, 10.0)

    def change(model: Model, v: NDArray[np.float64]) -> None:
        model.row[INDEX[name]] += v[0] * size

    def mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        return with_added(aircraft, {name: float(v[0]) * size})

    says = f"{symbol} ({name} {stated:.4g}) differs from the simulation's by {{0:+.0%}}"
    return Candidate("derivative", symbol, (parameter,), change, says, mend)


def _constant(name: str, least: float) -> Candidate:
    parameter = FreeParameter("change", "", 0.5 * least, 10.0 * least, least)

    def change(model: Model, v: NDArray[np.float64]) -> None:
        model.row[INDEX[name]] += v[0]

    def mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        return with_added(aircraft, {name: float(v[0])})

    says = f"{name} differs from the simulation's by {{0:+.4f}}: steady flight is trimmed otherwise"
    return Candidate("derivative", name, (parameter,), change, says, mend)
