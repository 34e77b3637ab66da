"""Icing as published for the DHC-6 Twin Otter: C_iced = (1 + eta k') C_clean.

The factors k' are those of the University of Illinois Smart Icing Systems group (Pokhariyal and Merret, 30
May 2000, aircraft files TwinOtterAllIce, TwinOtterWingIce and TwinOtterTailIce of the UIUC model in
FlightGear, after Bragg et al.; they rest on the flight tests of Ratvasky and Ranaudo, AIAA 93-0398).
Severity eta = 0.0675 is -10 % on CZ_alpha with ice everywhere; the files advise against more than about
0.4. Carrying them over to another aircraft is an assumption.
"""

from collections.abc import Mapping
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.conventions import Convention, display_name, unsteady_inertia
from wingwatch.aircraft.linearisation import TrimError, linearised_derivatives
from wingwatch.aircraft.structures import LATERAL, ModeStructure

__all__ = [
    "ICING_FACTORS",
    "ICING_SEVERITY_MAX",
    "IcingKind",
    "icing_direction",
    "icing_factor",
]

IcingKind = Literal["all", "wing", "tail"]

ICING_SEVERITY_MAX = 0.4
"""Largest eta that the published files advise."""

_COMMON: dict[str, float] = {
    "CZ0": 0.0,
    "CZq": -0.20741,
    "Cm0": 0.0,
    "Cmq": -0.51852,
    "CYbeta": -2.96296,
    "CYp": 0.0,
    "CYr": 0.0,
    "CYda": 0.0,
    "CYdr": -1.18519,
    "Clbeta": -1.48148,
    "Clp": -1.48148,
    "Clr": 0.0,
    "Clda": -1.48148,
    "Cldr": -1.18519,
    "Cnbeta": -2.96296,
    "Cnp": 0.0,
    "Cnr": -0.88889,
    "Cnda": 0.0,
    "Cndr": -1.18519,
}

ICING_FACTORS: Mapping[IcingKind, Mapping[str, float]] = {
    "all": _COMMON
    | {
        "CX0": 6.52696,
        "CXalpha": -0.14296,
        "CXalpha2": -1.59837,
        "CZalpha": -1.48148,
        "CZde": -1.40741,
        "Cmalpha": -1.46667,
        "Cmde": -1.48148,
    },
    "wing": _COMMON
    | {
        "CX0": 2.64444,
        "CXalpha": -0.03156,
        "CXalpha2": -0.13719,
        "CZalpha": -0.83259,
        "CZde": -0.33970,
        "Cmalpha": -0.28346,
        "Cmde": -0.26504,
    },
    "tail": _COMMON
    | {
        "CX0": 1.58844,
        "CXalpha": -0.04504,
        "CXalpha2": -0.58415,
        "CZalpha": -0.36593,
        "CZde": -1.05556,
        "Cmalpha": -0.53244,
        "Cmde": -1.24756,
    },
}
"""k' by place of the ice and by coefficient. CYda is not in the files: taken as unchanged, like Cnda."""


def icing_factor(symbol: str, kind: IcingKind = "all") -> float:
    """k' of the coefficient behind a concise derivative: ``z_w`` that of CZalpha, ``n_v`` that of Cnbeta."""
    return ICING_FACTORS[kind][display_name(symbol, Convention.AMERICAN).replace("_", "")]


@cache
def _named_factors(structure: ModeStructure, kind: IcingKind) -> tuple[tuple[str, str, str, float], ...]:
    """Symbol, its equation, its regressor and k' of each derivative."""
    return tuple((s, *s.split("_"), icing_factor(s, kind)) for s in structure.derivatives)  # type: ignore[misc]


def icing_direction(
    structure: ModeStructure,
    concise_values: ArrayLike,
    aircraft: Aircraft,
    condition: FlightCondition,
    kind: IcingKind = "all",
) -> NDArray[np.float64]:
    """How the concise derivatives move with icing severity: d(theta)/d(eta), exact for any eta.

    The aerodynamic part of each derivative scales by 1 + eta k'; the kinematic parts (U in z_q and y_r, W
    in y_p) do not, nor do the alphadot terms, for which nothing is published. Moments that are coupled are
    un-mixed first: pitch from M_wdot, roll and yaw from Ixz. The Dutch roll's n_x alone does not tell how
    much of it is rolling moment; that share is taken from the file's coefficients, and as none where it has
    no coefficients or no mass.

    Args:
        structure: the mode's structure.
        concise_values: the clean derivatives, shape (..., k), in the order of ``structure.derivatives``.
        aircraft: its [mass], [geometry] and [coefficients] serve where stated; nothing is required.
        condition: flight condition of the values.
        kind: where the ice is.

    Returns:
        Shape (..., k), units of the derivatives (severity has none).
    """
    theta = np.asarray(concise_values, dtype=np.float64)
    clean = dict(zip(structure.derivatives, np.moveaxis(theta, -1, 0), strict=True))
    kinematic = {
        "z_q": condition.forward_velocity_m_s,
        "y_r": -condition.forward_velocity_m_s,
        "y_p": condition.normal_velocity_m_s,
    }
    z_wdot, m_wdot = unsteady_inertia(aircraft, condition) if aircraft.geometry else (0.0, 0.0)
    mass = aircraft.mass
    coupling = m_wdot / mass.inertia_y_kg_m2 if mass else 0.0
    if mass:
        kinematic["z_q"] *= mass.mass_kg / (mass.mass_kg - z_wdot)
    moved: dict[str, NDArray[np.float64]] = {}
    for symbol, row, index, factor in _named_factors(structure, kind):
        value = clean[symbol]
        if row in "zy":
            moved[symbol] = factor * (value - kinematic.get(symbol, 0.0))
        elif row == "m":
            z = f"z_{index}"
            moved[symbol] = factor * (value - coupling * clean[z]) + coupling * moved[z]
    if "n" in structure.equations:
        moved |= _roll_and_yaw(structure, clean, aircraft, condition, kind)
    return np.stack([moved[symbol] for symbol in structure.derivatives], axis=-1)


def _roll_and_yaw(
    structure: ModeStructure,
    clean: Mapping[str, NDArray[np.float64]],
    aircraft: Aircraft,
    condition: FlightCondition,
    kind: IcingKind,
) -> dict[str, NDArray[np.float64]]:
    """d/d(eta) of l_x and n_x: L_x/I_x = l_x - a n_x, N_x/I_z = n_x - b l_x, a = I_xz/I_x, b = I_xz/I_z."""
    mass = aircraft.mass
    a = mass.inertia_xz_kg_m2 / mass.inertia_x_kg_m2 if mass else 0.0
    b = mass.inertia_xz_kg_m2 / mass.inertia_z_kg_m2 if mass else 0.0
    has_roll = structure == LATERAL
    rolling = clean if has_roll else _rolling_from_coefficients(aircraft, condition)
    out: dict[str, NDArray[np.float64]] = {}
    for index in structure.regressors:
        n, k_l = clean[f"n_{index}"], icing_factor(f"l_{index}", kind)
        k_n = icing_factor(f"n_{index}", kind)
        l_value = rolling.get(f"l_{index}")
        if l_value is None:
            out[f"n_{index}"] = k_n * n
            continue
        d_roll, d_yaw = k_l * (l_value - a * n), k_n * (n - b * l_value)
        out[f"n_{index}"] = (d_yaw + b * d_roll) / (1.0 - a * b)
        if has_roll:
            out[f"l_{index}"] = (d_roll + a * d_yaw) / (1.0 - a * b)
    return out


def _rolling_from_coefficients(aircraft: Aircraft, condition: FlightCondition) -> Mapping[str, float]:
    """Concise rolling moments at the condition, empty where the file cannot give them."""
    if aircraft.coefficients is None or aircraft.mass is None or aircraft.geometry is None:
        return {}
    if aircraft.mass.inertia_xz_kg_m2 == 0.0 or condition.configuration != "clean":
        return {}
    try:
        return linearised_derivatives(aircraft, condition, LATERAL)
    except TrimError:
        return {}
