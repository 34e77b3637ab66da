"""Concise, dimensional, British and American derivatives, and the way between (thesis tables B.3 to B.5).

The concise symbol (``m_q``) stays the key in every convention; value and unit change, ``display_name`` says
how the convention prints it. With S wing area, c mean chord, b span, V true airspeed, ρ density:

- dimensional: force or moment per unit of motion or deflection, N and N m;
- British: divided by ½ρVS for w and v, ½ρVS c for q, ½ρVS b for p and r, ½ρV²S for deflections, moments by
  a further c (pitch) or b (roll, yaw). Table B.3 prints ½ρV₀Sb for Y_ζ; a force per radian needs ½ρV₀²S, as
  Z_η has, and that is what stands here;
- American: as British, but rates in units of 2V/c and 2V/b, so rate derivatives are twice the British
  (table B.5). w/V and v/V stand for the angles: where alpha is not small, ``CZ_alpha`` here is the
  derivative by w/V at constant forward speed, which is what a linear model in body axes carries.

Concise and dimensional are tied by the mass matrices of equations B.8 and B.11, hence table B.4:

    z_x = (Z_x + m U for q) / (m - Z_wdot)      m_x = (M_x + M_wdot z_x) / I_y
    y_x = Y_x / m - U for r, + W for p          I_x l_x - I_xz n_x = L_x      I_z n_x - I_xz l_x = N_x

with U = V cos(alpha), W = V sin(alpha). The thesis has W = 0 by its choice of axes (3.12); body axes of a
real trim have not, so y_p keeps its W. With the forward equation the mass matrix has three rows
(``longitudinal_mass_matrix``), and x_q keeps -W.

Angle forms: z_alpha and y_beta are accelerations per radian, divided by ½ρV²S as a deflection is. The reduced rows of
phugoid and spiral are rates of an attitude: they know no mass, and are made non-dimensional by c/V and b/V (or half).
"""

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.structures import ModeStructure
from wingwatch.aircraft.vocabulary import MODEL_DERIVATIVES

__all__ = [
    "Affine",
    "AffineForm",
    "Convention",
    "affine",
    "convert",
    "convert_standard_errors",
    "display_name",
    "longitudinal_mass_matrix",
    "unit",
    "unsteady_inertia",
]

_PURPOSE = "conversion between conventions"


class Convention(StrEnum):
    """How a derivative is expressed."""

    CONCISE = "concise"
    DIMENSIONAL = "dimensional"
    BRITISH = "british"
    AMERICAN = "american"


_AMERICAN_INDEX = {
    "u": "u",
    "w": "alpha",
    "v": "beta",
    "alpha": "alpha",
    "beta": "beta",
    "theta": "theta",
    "phi": "phi",
    "p": "p",
    "q": "q",
    "r": "r",
    "eta": "de",
    "xi": "da",
    "zeta": "dr",
    "tau": "dt",
}
_AMERICAN_ROW = {
    "x": "CX", "z": "CZ", "y": "CY", "m": "Cm", "l": "Cl", "n": "Cn", "theta": "theta", "phi": "phi"
}  # fmt: skip
_MOMENTS = frozenset("lmn")
_ATTITUDES = frozenset(("theta", "phi"))
_PER_PRESSURE = frozenset(("eta", "xi", "zeta", "tau", "alpha", "beta", "theta", "phi"))
"""Indices whose derivatives go with the square of the airspeed: deflections and angles."""
_RATES = frozenset("pqr")
_ROWS = ("x", "z", "m", "y", "l", "n", "theta", "phi")


def display_name(symbol: str, convention: Convention) -> str:
    """How a convention prints a derivative: ``m_q``, ``M_q`` (dimensional and British), ``Cm_q``."""
    row, index = symbol.split("_")
    if convention is Convention.CONCISE or row in _ATTITUDES:
        return symbol
    if convention is Convention.AMERICAN:
        return f"{_AMERICAN_ROW[row]}_{_AMERICAN_INDEX[index]}"
    return f"{row.upper()}_{index}"


def unit(symbol: str, convention: Convention) -> str:
    """Unit of a derivative in a convention (rad left out), empty where it has none."""
    row, index = symbol.split("_")
    if convention is Convention.CONCISE:
        return MODEL_DERIVATIVES[symbol].unit
    if convention is not Convention.DIMENSIONAL:
        return ""
    if row in _ATTITUDES:
        return MODEL_DERIVATIVES[symbol].unit
    if index in _PER_PRESSURE:
        return "N m" if row in _MOMENTS else "N"
    if index in _RATES:
        return "N m s" if row in _MOMENTS else "N s"
    return "N s" if row in _MOMENTS else "N s/m"


def unsteady_inertia(aircraft: Aircraft, condition: FlightCondition) -> tuple[float, float]:
    """(Z_wdot in kg, M_wdot in kg m) from the file's alphadot coefficients; zeros where it has none.

    Z_wdot = -¼ρSc cos²α CL_alphadot, M_wdot = ¼ρSc² cosα Cm_alphadot: dα/dt = cosα dw/dt / V at constant
    forward speed, and the lift turned into body axes. Both concern thesis table B.4. A centre of gravity behind the
    coefficients' point adds the moment of Z_wdot.
    """
    coefficients = aircraft.coefficients
    if coefficients is None or (coefficients.CL.alphadot == 0.0 and coefficients.Cm.alphadot == 0.0):
        return 0.0, 0.0
    geometry = aircraft.need_geometry(_PURPOSE)
    cos = math.cos(condition.angle_of_attack_rad)
    chord = geometry.mean_chord_m
    common = 0.25 * condition.air_density_kg_m3 * geometry.wing_area_m2 * chord * cos
    z_wdot = -common * cos * coefficients.CL.alphadot
    return z_wdot, common * chord * coefficients.Cm.alphadot - aircraft.cg_shift_m * z_wdot


def longitudinal_mass_matrix(aircraft: Aircraft, condition: FlightCondition) -> NDArray[np.float64]:
    """Mass matrix of (du/dt, dw/dt, dq/dt), shape (3, 3), in kg, kg m and kg m2 (thesis equation B.8 with x).

    Off its diagonal stand the alphadot terms, d(alpha)/dt = (cos(alpha) dw/dt - sin(alpha) du/dt) / V; with du/dt left
    out, as the short period has it, they are those of ``unsteady_inertia``.

    Raises:
        AircraftDataError: the file lacks [mass], or [geometry] with alphadot coefficients.
    """
    mass = aircraft.need_mass(_PURPOSE)
    matrix = np.diag([mass.mass_kg, mass.mass_kg, mass.inertia_y_kg_m2])
    z_wdot, m_wdot = unsteady_inertia(aircraft, condition)
    slope = math.tan(condition.angle_of_attack_rad)
    by_wdot = np.array([-z_wdot * slope, z_wdot, m_wdot])
    matrix[:, 1] -= by_wdot
    matrix[:, 0] += slope * by_wdot
    return matrix


class _Powers(NamedTuple):
    """What goes into the derivatives of a structure, in their order, (k,) each: powers of geometry, the American
    halves, signs of the offsets' velocities, and places in ``_ROWS`` and in ``_by_condition``."""

    area: NDArray[np.float64]
    span: NDArray[np.float64]
    chord: NDArray[np.float64]
    half: NDArray[np.float64]
    forward: NDArray[np.float64]
    normal: NDArray[np.float64]
    row: NDArray[np.int64]
    condition: NDArray[np.int64]


@cache
def _powers(structure: ModeStructure) -> _Powers:
    parts = [symbol.split("_") for symbol in structure.derivatives]
    attitude = np.array([row in _ATTITUDES for row, _ in parts])
    speed = np.array([2 if x in _PER_PRESSURE else 1 for _, x in parts])
    half = np.array([0.5 if x in _RATES else 1.0 for _, x in parts])
    return _Powers(
        area=np.where(attitude, 0.0, 1.0),
        span=np.array(
            [float(row in "ln") + float(x in ("p", "r")) - float(row == "phi") for row, x in parts]
        ),
        chord=np.array([float(row == "m") + float(x == "q") - float(row == "theta") for row, x in parts]),
        half=np.where(attitude, 2.0, half),
        forward=np.array([{"z_q": 1.0, "y_r": -1.0}.get("_".join(part), 0.0) for part in parts]),
        normal=np.array([{"y_p": 1.0, "x_q": -1.0}.get("_".join(part), 0.0) for part in parts]),
        row=np.array([_ROWS.index(row) for row, _ in parts]),
        condition=np.where(attitude, speed - 1, 3 + speed),
    )


def _by_condition(condition: FlightCondition) -> tuple[float, ...]:
    """1, V, V^2, and density times these."""
    speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
    return 1.0, speed, speed * speed, density, density * speed, density * speed * speed


def _by_geometry(structure: ModeStructure, aircraft: Aircraft, convention: Convention) -> NDArray[np.float64]:
    """The part of ``_multiplier`` that no condition changes, shape (k,)."""
    geometry = aircraft.need_geometry(_PURPOSE)
    powers = _powers(structure)
    multiplier = (
        (0.5 * geometry.wing_area_m2) ** powers.area
        * geometry.span_m**powers.span
        * geometry.mean_chord_m**powers.chord
    )
    return multiplier * powers.half if convention is Convention.AMERICAN else multiplier


def _multiplier(
    structure: ModeStructure, aircraft: Aircraft, condition: FlightCondition, convention: Convention
) -> NDArray[np.float64]:
    """Dimensional over the convention's derivative, shape (k,) (thesis tables B.3 and B.5)."""
    if convention is Convention.DIMENSIONAL:
        return np.ones(len(structure.derivatives))
    by_condition = np.array(_by_condition(condition))[_powers(structure).condition]
    return np.asarray(_by_geometry(structure, aircraft, convention) * by_condition)


class Affine(NamedTuple):
    """``concise = scale * coordinate + offset`` (``affine``): at one flight condition (k,), or at each of m (m, k)."""

    scale: NDArray[np.float64]
    offset: NDArray[np.float64]

    def from_concise(
        self, value: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A concise value (..., k) and its covariance (..., k, k) in the coordinates."""
        return (value - self.offset) / self.scale, covariance / self._both

    def to_concise(
        self, value: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Inverse of ``from_concise``: a concise value (..., k) and its covariance (..., k, k)."""
        return self.scale * value + self.offset, covariance * self._both

    @property
    def _both(self) -> NDArray[np.float64]:
        """Products of scales, (..., k, k)."""
        return self.scale[..., :, None] * self.scale[..., None, :]


class AffineForm:
    """``affine`` of one structure of one aircraft; what no condition changes is worked out once.

    Args:
        structure: the mode's structure.
        aircraft: needs [mass], and [geometry] unless ``target`` is dimensional.
        target: as in ``affine``, but not concise.

    Raises:
        AircraftDataError: the file lacks [geometry] or [mass].
    """

    def __init__(
        self, structure: ModeStructure, aircraft: Aircraft, target: Convention = Convention.AMERICAN
    ) -> None:
        mass, powers = aircraft.need_mass(_PURPOSE), _powers(structure)
        m = mass.mass_kg
        inertia = np.array(
            [m, m, mass.inertia_y_kg_m2, m, mass.inertia_x_kg_m2, mass.inertia_z_kg_m2, 1.0, 1.0]
        )
        dimensional = target is Convention.DIMENSIONAL
        fixed = 1.0 if dimensional else _by_geometry(structure, aircraft, target)
        self._aircraft, self._mass_kg, self._powers = aircraft, m, powers
        self._fixed = fixed / inertia[powers.row]
        self._place = np.zeros_like(powers.condition) if dimensional else powers.condition
        self._heaves = powers.row == _ROWS.index("z")

    def kinematic(self, conditions: Sequence[FlightCondition]) -> NDArray[np.float64]:
        """The part of each concise derivative that no force makes, shape (m, k): U in z_q, -U in y_r, W in y_p."""
        powers = self._powers
        forward = np.array([[c.forward_velocity_m_s] for c in conditions])
        normal = np.array([[c.normal_velocity_m_s] for c in conditions])
        return np.asarray(powers.forward * forward + powers.normal * normal)

    def at(self, conditions: Sequence[FlightCondition]) -> Affine:
        """``affine`` at m conditions, scale and offset of shape (m, k) each."""
        by_condition = np.array([_by_condition(c) for c in conditions])
        scale, offset = self._fixed * by_condition[:, self._place], self.kinematic(conditions)
        z_wdot = np.array([unsteady_inertia(self._aircraft, c)[0] for c in conditions])
        if not z_wdot.any():
            return Affine(scale, offset)
        ratio = np.where(self._heaves, self._mass_kg / (self._mass_kg - z_wdot[:, None]), 1.0)
        return Affine(scale * ratio, offset * ratio)


def affine(
    structure: ModeStructure,
    aircraft: Aircraft,
    condition: FlightCondition,
    target: Convention = Convention.AMERICAN,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scale and offset with ``concise = scale * value + offset``, one derivative at a time.

    ``value`` is the *effective* derivative in the convention ``target``: for roll and yaw moments the
    primed, Ixz-coupled one, ``Cn' = I_z (I_x Cn + I_xz Cl) / (I_x I_z - I_xz²)`` and its like for Cl; for
    pitch moments of an aircraft with alphadot terms the one with M_wdot z_x inside. Both are nearly the
    same at every condition, which is what carries an expectation or an estimate from one to another without
    knowing its neighbours. ``convert`` un-mixes them. Standard errors scale with ``scale`` alone.

    Args:
        structure: the mode's structure.
        aircraft: needs [geometry] and [mass], unless ``target`` is concise.
        condition: airspeed, density and angle of attack count.
        target: convention of ``value``.

    Returns:
        (scale, offset), each of shape (k,) in the order of ``structure.derivatives``.

    Raises:
        AircraftDataError: the file lacks [geometry] or [mass].
    """
    if target is Convention.CONCISE:
        k = len(structure.derivatives)
        return np.ones(k), np.zeros(k)
    scale, offset = AffineForm(structure, aircraft, target).at([condition])
    return scale[0], offset[0]


def _check_names(values: Mapping[str, float], structure: ModeStructure) -> None:
    expected = structure.derivatives
    if set(values) != set(expected):
        wrong = sorted(set(values) ^ set(expected))
        raise ValueError(
            f"{structure.name} has the derivatives {', '.join(expected)}; "
            f"missing or unknown here: {', '.join(wrong)}"
        )


def _to_dimensional(
    concise: Mapping[str, float], aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure
) -> dict[str, float]:
    """Multiply by the mass matrix (thesis B.8, B.11) and take the kinematic terms out."""
    mass = aircraft.need_mass(_PURPOSE)
    z_wdot, m_wdot = unsteady_inertia(aircraft, condition)
    m, forward, normal = mass.mass_kg, condition.forward_velocity_m_s, condition.normal_velocity_m_s
    out: dict[str, float] = {}
    if _is_full_longitudinal(structure):
        return _through_mass_matrix(concise, aircraft, condition, structure, to_concise=False)
    coupled = {"l", "n"} <= set(structure.equations)
    for symbol in structure.derivatives:
        row, index = symbol.split("_")
        value = concise[symbol]
        if row == "x":
            out[symbol] = m * value
        elif row in _ATTITUDES:
            out[symbol] = value
        elif row == "z":
            out[symbol] = (m - z_wdot) * value - (m * forward if index == "q" else 0.0)
        elif row == "m":
            out[symbol] = mass.inertia_y_kg_m2 * value - m_wdot * concise[f"z_{index}"]
        elif row == "y":
            out[symbol] = m * (value - {"p": normal, "r": -forward}.get(index, 0.0))
        elif row == "l":
            yawing = mass.inertia_xz_kg_m2 * concise[f"n_{index}"] if coupled else 0.0
            out[symbol] = mass.inertia_x_kg_m2 * value - yawing
        else:
            rolling = mass.inertia_xz_kg_m2 * concise[f"l_{index}"] if coupled else 0.0
            out[symbol] = mass.inertia_z_kg_m2 * value - rolling
    return out


def _is_full_longitudinal(structure: ModeStructure) -> bool:
    return structure.equations == ("x", "z", "m")


def _through_mass_matrix(
    values: Mapping[str, float],
    aircraft: Aircraft,
    condition: FlightCondition,
    structure: ModeStructure,
    *,
    to_concise: bool,
) -> dict[str, float]:
    """Rows x, z, m between dimensional and concise: M concise = dimensional + m (-W, U, 0) for q."""
    shape = (len(structure.equations), len(structure.regressors))
    given = np.array([values[s] for s in structure.derivatives]).reshape(shape)
    matrix, m = longitudinal_mass_matrix(aircraft, condition), aircraft.need_mass(_PURPOSE).mass_kg
    kinematic = np.zeros(shape)
    kinematic[:2, structure.regressors.index("q")] = (
        -m * condition.normal_velocity_m_s,
        m * condition.forward_velocity_m_s,
    )
    out = np.linalg.solve(matrix, given + kinematic) if to_concise else matrix @ given - kinematic
    return dict(zip(structure.derivatives, out.ravel().tolist(), strict=True))


def _to_concise(
    dimensional: Mapping[str, float], aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure
) -> dict[str, float]:
    """The inverse of ``_to_dimensional``: thesis table B.4."""
    mass = aircraft.need_mass(_PURPOSE)
    z_wdot, m_wdot = unsteady_inertia(aircraft, condition)
    m, forward, normal = mass.mass_kg, condition.forward_velocity_m_s, condition.normal_velocity_m_s
    i_x, i_z, i_xz = mass.inertia_x_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2
    determinant = i_x * i_z - i_xz**2
    out: dict[str, float] = {}
    if _is_full_longitudinal(structure):
        return _through_mass_matrix(dimensional, aircraft, condition, structure, to_concise=True)
    coupled = {"l", "n"} <= set(structure.equations)
    for symbol in structure.derivatives:
        row, index = symbol.split("_")
        value = dimensional[symbol]
        if row == "x":
            out[symbol] = value / m
        elif row in _ATTITUDES:
            out[symbol] = value
        elif row == "z":
            out[symbol] = (value + (m * forward if index == "q" else 0.0)) / (m - z_wdot)
        elif row == "m":
            out[symbol] = (value + m_wdot * out[f"z_{index}"]) / mass.inertia_y_kg_m2
        elif row == "y":
            out[symbol] = value / m + {"p": normal, "r": -forward}.get(index, 0.0)
        elif row == "l":
            out[symbol] = (
                (i_z * value + i_xz * dimensional[f"n_{index}"]) / determinant if coupled else value / i_x
            )
        elif coupled:
            out[symbol] = (i_x * value + i_xz * dimensional[f"l_{index}"]) / determinant
        else:
            out[symbol] = value / i_z
    return out


def convert(
    values: Mapping[str, float],
    *,
    aircraft: Aircraft,
    condition: FlightCondition,
    structure: ModeStructure,
    source: Convention,
    target: Convention,
) -> dict[str, float]:
    """All derivatives of a structure from one convention to another; a round trip returns them to rounding.

    With both lateral moments the roll and yaw moments are un-mixed through Ixz. The Dutch roll alone has no rolling
    moment and the roll no yawing moment, so theirs stay the effective ones of ``affine``; so do the phugoid's.

    Args:
        values: every derivative of the structure by its concise symbol, in units of ``source``; NaN stays
            NaN.
        aircraft: needs [geometry] and [mass] unless source and target are the same.
        condition: flight condition of the values.
        structure: the mode's structure.
        source: convention of ``values``.
        target: convention of the result.

    Returns:
        The same symbols with values in units of ``target``.

    Raises:
        AircraftDataError: the file lacks [geometry] or [mass].
        ValueError: a derivative of the structure is absent or an unknown one is present.
    """
    _check_names(values, structure)
    if source is target:
        return {symbol: float(values[symbol]) for symbol in structure.derivatives}
    if source is Convention.CONCISE:
        dimensional = _to_dimensional(values, aircraft, condition, structure)
    else:
        multiplier = _multiplier(structure, aircraft, condition, source)
        dimensional = {
            s: values[s] * float(f) for s, f in zip(structure.derivatives, multiplier, strict=True)
        }
    if target is Convention.CONCISE:
        return _to_concise(dimensional, aircraft, condition, structure)
    multiplier = _multiplier(structure, aircraft, condition, target)
    return {s: dimensional[s] / float(f) for s, f in zip(structure.derivatives, multiplier, strict=True)}


def convert_standard_errors(
    standard_errors: Mapping[str, float],
    *,
    aircraft: Aircraft,
    condition: FlightCondition,
    structure: ModeStructure,
    source: Convention,
    target: Convention,
) -> dict[str, float]:
    """Standard errors carried through ``convert``, errors of different derivatives taken as independent.

    Arguments and errors are those of ``convert``; the conversion is linear, so the root sum of squares of its
    partial derivatives times the errors is exact for independent errors.
    """
    _check_names(standard_errors, structure)
    zeros = dict.fromkeys(structure.derivatives, 0.0)

    def converted(values: Mapping[str, float]) -> dict[str, float]:
        return convert(
            values, aircraft=aircraft, condition=condition, structure=structure, source=source, target=target
        )

    base = converted(zeros)
    variance = dict.fromkeys(structure.derivatives, 0.0)
    for symbol, error in standard_errors.items():
        unit_step = converted({**zeros, symbol: 1.0})
        for other, value in unit_step.items():
            partial = value - base[other]
            if partial != 0.0:
                variance[other] += (partial * error) ** 2
    return {symbol: math.sqrt(v) for symbol, v in variance.items()}
