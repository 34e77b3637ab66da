"""The Twin Otter as its icing studies published it: CX and CZ along body axes, linear ice factors on every coefficient.

Written from the published form (Aircraft-uiuc/TwinOtterAllIce/aircraft.dat of the UIUC model in FlightGear, after
Pokhariyal and Merret 2000) and Newton and Euler alone, so that the library's lift and drag, and the simulated icing
effect, have something to be held to. Mass, inertias and dimensions are the library file's.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from wingwatch.aircraft import GRAVITY_M_S2, ICING_FACTORS, Aircraft, FlightCondition, IcingKind

__all__ = ["CLEAN", "PublishedTwinOtter"]

CLEAN: Mapping[str, float] = {
    "CX0": -0.0488, "CXalpha": 0.223, "CXalpha2": 1.659,
    "CZ0": -0.36, "CZalpha": -5.66, "CZq": -19.97, "CZde": -0.608,
    "Cm0": 0.04, "Cmalpha": -1.31, "Cmq": -34.2, "Cmde": -1.74,
    "CYbeta": -0.6, "CYp": -0.2, "CYr": 0.4, "CYda": 0.0, "CYdr": 0.15,
    "Clbeta": -0.08, "Clp": -0.5, "Clr": 0.06, "Clda": -0.15, "Cldr": 0.015,
    "Cnbeta": 0.1, "Cnp": -0.06, "Cnr": -0.18, "Cnda": -0.001, "Cndr": -0.125,
}  # fmt: skip
"""Per radian; rates by c/2V and b/2V."""

_COLUMNS = ("u", "v", "w", "p", "q", "r", "eta", "xi", "zeta")


class PublishedTwinOtter:
    """The published model under ice of a severity.

    Args:
        aircraft: the library's Twin Otter, for mass and dimensions.
        severity: eta of C = (1 + eta k') C_clean.
        kind: where the ice is.
    """

    def __init__(self, aircraft: Aircraft, severity: float = 0.0, kind: IcingKind = "all") -> None:
        factors = ICING_FACTORS[kind]
        self.coefficients = {name: value * (1.0 + severity * factors[name]) for name, value in CLEAN.items()}
        self._mass, self._geometry = (
            aircraft.need_mass("the comparison"),
            aircraft.need_geometry("the comparison"),
        )

    def _accelerations(
        self, x: NDArray[np.float64], thrust_n: float, pitch_rad: float, density_kg_m3: float
    ) -> NDArray[np.float64]:
        """du/dt ... dr/dt of ``_COLUMNS``, wings level."""
        u, v, w, p, q, r, eta, xi, zeta = x.tolist()
        c, m, g = self.coefficients, self._mass, self._geometry
        speed = math.sqrt(u * u + v * v + w * w)
        alpha, beta = math.atan2(w, u), math.asin(v / speed)
        span, chord = 0.5 * g.span_m / speed, 0.5 * g.mean_chord_m / speed

        def lateral(row: str) -> float:
            terms = {"beta": beta, "p": p * span, "r": r * span, "da": xi, "dr": zeta}
            return math.fsum(c[row + name] * value for name, value in terms.items())

        push = 0.5 * density_kg_m3 * speed**2 * g.wing_area_m2
        along = c["CX0"] + c["CXalpha"] * alpha + c["CXalpha2"] * alpha**2
        normal = c["CZ0"] + c["CZalpha"] * alpha + c["CZq"] * q * chord + c["CZde"] * eta
        pitching = c["Cm0"] + c["Cmalpha"] * alpha + c["Cmq"] * q * chord + c["Cmde"] * eta
        weight = GRAVITY_M_S2 * np.array([-math.sin(pitch_rad), 0.0, math.cos(pitch_rad)])
        force = np.array([push * along + thrust_n, push * lateral("CY"), push * normal]) / m.mass_kg + weight
        rates = np.array([p, q, r])
        inertia = np.diag([m.inertia_x_kg_m2, m.inertia_y_kg_m2, m.inertia_z_kg_m2])
        inertia[0, 2] = inertia[2, 0] = -m.inertia_xz_kg_m2
        moment = push * np.array(
            [g.span_m * lateral("Cl"), g.mean_chord_m * pitching, g.span_m * lateral("Cn")]
        )
        spin = np.linalg.solve(inertia, moment - np.cross(rates, inertia @ rates))
        return np.concatenate([force - np.cross(rates, x[:3]), spin])

    def trim(self, condition: FlightCondition) -> tuple[float, float, float]:
        """Angle of attack and elevator in rad and thrust in N of level flight."""
        weight = self._mass.mass_kg * GRAVITY_M_S2

        def left(y: NDArray[np.float64]) -> NDArray[np.float64]:
            x, density = self._level(condition, float(y[0]), float(y[1])), condition.air_density_kg_m3
            return self._accelerations(x, float(y[2]) * weight, float(y[0]), density)[[0, 2, 4]]

        y = root(left, np.array([0.03, 0.0, 0.1]), tol=1e-13).x
        return float(y[0]), float(y[1]), float(y[2]) * weight

    @staticmethod
    def _level(condition: FlightCondition, alpha: float, elevator: float) -> NDArray[np.float64]:
        x = np.zeros(len(_COLUMNS))
        x[0], x[2] = (
            condition.airspeed_true_m_s * math.cos(alpha),
            condition.airspeed_true_m_s * math.sin(alpha),
        )
        x[6] = elevator
        return x

    def concise(self, condition: FlightCondition) -> dict[str, float]:
        """Every concise derivative (``z_w`` to ``n_zeta``) at level trim, by central differences."""
        alpha, elevator, thrust = self.trim(condition)
        at = self._level(condition, alpha, elevator)
        out: dict[str, float] = {}
        for i, column in enumerate(_COLUMNS):
            step = np.zeros(len(_COLUMNS))
            step[i] = 1e-3 if i < 3 else 1e-5
            ends = [
                self._accelerations(at + sign * step, thrust, alpha, condition.air_density_kg_m3)
                for sign in (1.0, -1.0)
            ]
            out |= {
                f"{row}_{column}": float(e)
                for row, e in zip("xyzlmn", (ends[0] - ends[1]) / (2.0 * step[i]), strict=True)
            }
        return out
