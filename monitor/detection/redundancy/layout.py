"""The relations between channels that hold whatever the flight, and what each faulty part does to them.

Every relation is one scalar equation, z = x + sum over j of d_j delta_j + noise,  dx/dt = rate + sum of psi_j delta_j -
x/tau + noise, with z and rate made of channels (``samples.py``); its parameters delta are faults, each in the size that
the vocabulary of causes gives it. tau is infinite but for relations without a rate of their own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "COLUMNS",
    "FLOORS",
    "FLOW",
    "GUSTY",
    "GUST_FELT",
    "PARAMETERS",
    "PARAMETERS_OF_ROW",
    "PRIORS",
    "PRIOR_INFORMATION",
    "RELATIONS",
    "ROUGH",
    "ROWS",
    "Parameter",
    "Relation",
    "parameter_index",
]

COLUMNS = 6
"""Parameters of a relation, at most."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a relation.

    Attributes:
        name: of the fault, with the part that has it.
        prior: standard deviation of its constant part, which the flight itself teaches.
        floor: standard deviation of what it may change by within a minute in a healthy aircraft.
        unit: of both.
    """

    name: str
    prior: float
    floor: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Relation:
    """One relation.

    Attributes:
        name: what it relates, for a person.
        channels: whose contradiction it shows.
        parameters: at most ``COLUMNS``.
        noise_std: of z beside the rest, where the aircraft file states no noise of the first channel.
        least_noise_std: of z, whatever the file states: mounting, lags, and the sampling of quick motion.
        drift: variance of x a second over noise_std squared, at first; learned in flight.
        leak_s: tau.
    """

    name: str
    channels: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    noise_std: float
    drift: float
    leak_s: float = np.inf
    least_noise_std: float = 0.0


def _surface(name: str) -> Relation:
    return Relation(
        f"{name} position against its command",
        (f"{name}_rad", f"{name}_command_rad"),
        (
            Parameter("offset", 0.05, 0.002, "rad"),
            Parameter("not following", 0.2, 0.03),
            Parameter("lag", 0.05, 0.01, "s"),
        ),
        noise_std=0.001,
        drift=1e-3,
        leak_s=5.0,
        least_noise_std=0.0005,
    )


def _attitude(angle: str, rate: str, other: str) -> Relation:
    parameters = [
        Parameter(f"{rate} bias", 0.02, 0.002, "rad/s"),
        Parameter(f"{rate} scale", 0.05, 0.005),
        Parameter(f"{rate} delay", 0.05, 0.005, "s"),
        Parameter(f"{angle} bias", 0.05, 0.003, "rad"),
    ]
    if other:
        parameters.append(Parameter(f"{other} bias", 0.02, 0.002, "rad/s"))
    parameters.append(Parameter("misalignment of the gyros", 0.03, 0.005, "rad"))
    return Relation(
        f"{angle} against the gyros", (angle, rate), tuple(parameters), 0.0035, 1e-3, least_noise_std=0.002
    )


def _coefficients(name: str, flow: str, others: tuple[str, ...]) -> tuple[Parameter, ...]:
    """What a coefficient is made of: an offset, as an angle of flow (forces) or of the surface (moments) that would
    make it, and terms as fractions of the file's."""
    return (
        Parameter(f"{name} offset", 0.05, 0.002, "rad"),
        Parameter(f"{name} by {flow}", 0.3, 0.02),
        *(Parameter(f"{name} by {other}", 0.5, 0.03) for other in others),
    )


def _moment(name: str, channels: tuple[str, ...], parameters: tuple[Parameter, ...]) -> Relation:
    return Relation(
        f"{name} against what makes it", channels, parameters, noise_std=0.006, drift=0.05, leak_s=0.15
    )


_LONGITUDINAL = ("pitch rate", "elevator", "change of angle of attack")
_LATERAL = ("roll rate", "yaw rate", "aileron", "rudder")
_ROLL_RATE, _PITCH_RATE, _YAW_RATE = "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"
_FX, _FY, _FZ = (f"specific_force_{axis}_m_s2" for axis in "xyz")
_SPEED, _ALPHA, _BETA = "airspeed_true_m_s", "angle_of_attack_rad", "sideslip_rad"

RELATIONS: tuple[Relation, ...] = (
    _surface("elevator"),
    _surface("aileron"),
    _surface("rudder"),
    _attitude("roll_rad", _ROLL_RATE, ""),
    _attitude("pitch_rad", _PITCH_RATE, _YAW_RATE),
    _attitude("heading_rad", _YAW_RATE, _PITCH_RATE),
    Relation(
        "airspeed against accelerometers and attitude",
        (_SPEED, _FX),
        (
            Parameter(f"{_SPEED} scale", 0.05, 0.01),
            Parameter(f"{_SPEED} not following", 0.3, 0.1),
            Parameter(f"{_FX} bias", 0.2, 0.02, "m/s2"),
            Parameter("pitch_rad bias", 0.02, 0.002, "rad"),
            Parameter(f"{_ALPHA} bias", 0.05, 0.005, "rad"),
        ),
        noise_std=0.2,
        drift=0.5,
        least_noise_std=0.1,
    ),
    Relation(
        "angle of attack against gyros and accelerometers",
        (_ALPHA, _FZ),
        (
            Parameter(f"{_ALPHA} bias", 0.05, 0.003, "rad"),
            Parameter(f"{_ALPHA} scale", 0.5, 0.2),
            Parameter(f"{_ALPHA} delay", 0.05, 0.005, "s"),
            Parameter(f"{_FZ} bias", 0.3, 0.03, "m/s2"),
            Parameter(f"{_PITCH_RATE} bias", 0.02, 0.002, "rad/s"),
            Parameter(f"{_SPEED} scale", 0.05, 0.01),
        ),
        noise_std=0.0035,
        drift=0.5,
        least_noise_std=0.002,
    ),
    Relation(
        "sideslip against gyros and accelerometers",
        (_BETA, _FY),
        (
            Parameter(f"{_BETA} bias", 0.05, 0.003, "rad"),
            Parameter(f"{_BETA} scale", 0.5, 0.2),
            Parameter(f"{_BETA} delay", 0.05, 0.005, "s"),
            Parameter(f"{_FY} bias", 0.3, 0.03, "m/s2"),
            Parameter(f"{_YAW_RATE} bias", 0.02, 0.002, "rad/s"),
            Parameter("roll_rad bias", 0.02, 0.002, "rad"),
        ),
        noise_std=0.0035,
        drift=0.5,
        least_noise_std=0.002,
    ),
    Relation(
        "axial force against throttle and lift",
        (_FX, "throttle"),
        (
            Parameter("thrust loss", 0.3, 0.01),
            Parameter("drag", 0.5, 0.02),
            Parameter("lift's axial part", 0.1, 0.002),
            Parameter("induced drag", 0.7, 0.03),
            Parameter(f"{_FX} bias", 0.2, 0.01, "m/s2"),
            Parameter(f"{_SPEED} scale", 0.05, 0.005),
        ),
        noise_std=0.05,
        drift=0.05,
        leak_s=5.0,
        least_noise_std=0.05,
    ),
    Relation(
        "airspeed and heading against the velocity north",
        (_SPEED, "velocity_north_m_s"),
        (
            Parameter(f"{_SPEED} scale", 0.05, 0.01),
            Parameter("heading_rad bias", 0.1, 0.01, "rad"),
            Parameter("ground velocity bias", 0.5, 0.1, "m/s"),
        ),
        noise_std=0.2,
        drift=0.5,
        least_noise_std=0.1,
    ),
    Relation(
        "airspeed and heading against the velocity east",
        (_SPEED, "velocity_east_m_s"),
        (
            Parameter(f"{_SPEED} scale", 0.05, 0.01),
            Parameter("heading_rad bias", 0.1, 0.01, "rad"),
            Parameter("ground velocity bias", 0.5, 0.1, "m/s"),
        ),
        noise_std=0.2,
        drift=0.5,
        least_noise_std=0.1,
    ),
    Relation(
        "normal force against angle of attack",
        (_FZ, _ALPHA),
        _coefficients("lift", "angle of attack", _LONGITUDINAL),
        noise_std=0.2,
        drift=0.05,
        leak_s=1.0,
    ),
    Relation(
        "side force against sideslip",
        (_FY, _BETA),
        _coefficients("side force", "sideslip", _LATERAL),
        noise_std=0.1,
        drift=0.05,
        leak_s=1.0,
    ),
    _moment("rolling moment", (_ROLL_RATE, _BETA), _coefficients("rolling moment", "sideslip", _LATERAL)),
    _moment(
        "pitching moment",
        (_PITCH_RATE, _ALPHA),
        _coefficients("pitching moment", "angle of attack", _LONGITUDINAL),
    ),
    _moment("yawing moment", (_YAW_RATE, _BETA), _coefficients("yawing moment", "sideslip", _LATERAL)),
)
"""In the order of every array's relation axis."""

(
    ELEVATOR,
    AILERON,
    RUDDER,
    ROLL,
    PITCH,
    HEADING,
    AIRSPEED,
    ALPHA,
    BETA,
    AXIAL,
    NORTH,
    EAST,
    LIFT,
    SIDE,
    ROLLING,
    PITCHING,
    YAWING,
) = range(len(RELATIONS))

FLOW = (AIRSPEED, ALPHA, BETA)
"""Relations that tell how rough the air is."""
GUSTY = (AIRSPEED, ALPHA, BETA, NORTH, EAST, LIFT, SIDE, ROLLING, PITCHING, YAWING)
"""Relations that gusts disturb: each is filtered twice, by the air as it is and by rougher air."""
ROWS = (*range(len(RELATIONS)), *GUSTY)
"""Relation of every filter: in the air as it is, then in rougher air."""
ROUGH = np.array([len(RELATIONS) + GUSTY.index(i) if i in GUSTY else -1 for i in range(len(RELATIONS))])
"""Row of each relation's filter in rougher air; -1 where it has none."""

PARAMETERS: tuple[tuple[str, ...], ...] = tuple(tuple(p.name for p in r.parameters) for r in RELATIONS)


def _table(what: str, absent: float) -> NDArray[np.float64]:
    out = np.full((len(RELATIONS), COLUMNS), absent)
    for i, relation in enumerate(RELATIONS):
        for j, parameter in enumerate(relation.parameters):
            out[i, j] = getattr(parameter, what)
    return out


PRIORS = _table("prior", 1e-9)
"""(relations, COLUMNS); a column without a parameter has information 0."""
FLOORS = _table("floor", 0.0)
"""(relations, COLUMNS)."""


def parameter_index(relation: int, name: str) -> int:
    """Column of a parameter; ValueError for one that the relation has not."""
    return PARAMETERS[relation].index(name)


def _felt() -> NDArray[np.float64]:
    felt = np.zeros((len(RELATIONS), COLUMNS))
    felt[LIFT:] = FLOORS[LIFT:] > 0.0
    for name in ("drag", "lift's axial part", "induced drag"):
        felt[AXIAL, parameter_index(AXIAL, name)] = 1.0
    return felt


GUST_FELT = _felt()
"""(relations, COLUMNS), 1 where a parameter is in part what gusts do: they act otherwise than the aircraft's motion."""


PRIOR_INFORMATION = PRIORS[list(ROWS)] ** -2.0
"""(rows, COLUMNS)."""

PARAMETERS_OF_ROW = np.array([len(PARAMETERS[i]) for i in ROWS])
"""How many parameters each row has; the columns behind them hold nothing."""
