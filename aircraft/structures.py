"""Model structures: which states, inputs and equations a mode's linear model has (thesis 3.3)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

__all__ = [
    "DUTCH_ROLL",
    "DUTCH_ROLL_BETA",
    "LATERAL",
    "LATERAL_FULL",
    "LONGITUDINAL",
    "LONGITUDINAL_THROTTLE",
    "MODEL_STRUCTURES",
    "ModeStructure",
    "PHUGOID",
    "ROLL",
    "SHORT_PERIOD",
    "SHORT_PERIOD_ALPHA",
    "SPIRAL",
    "STRUCTURES",
]


@dataclass(frozen=True)
class ModeStructure:
    """The linear model of one mode: ``dx/dt = A x + B u + constant``, row by row.

    Attributes:
        name: key in every interface, such as ``short_period``.
        states: symbols of the states whose columns the equations have.
        inputs: symbols of the control inputs (eta elevator, xi aileron, zeta rudder, tau throttle).
        equations: first letters of the equations, in the order of their own states.
        description: one line.
        attitudes: further states (Euler angles) whose rows are kinematics and whose columns are gravity: nothing
            of them is a derivative to be found. They follow ``states`` in A (``state_space``).
        oscillations: names of the modes that are a pair of roots in a conventional aircraft, fastest first.
        subsidences: names of those that are one real root, fastest first.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    equations: tuple[str, ...]
    description: str
    attitudes: tuple[str, ...] = ()
    oscillations: tuple[str, ...] = ()
    subsidences: tuple[str, ...] = ()

    @cached_property
    def regressors(self) -> tuple[str, ...]:
        """States, then inputs: the columns of every equation."""
        return self.states + self.inputs

    @cached_property
    def derivatives(self) -> tuple[str, ...]:
        """Symbols of all derivatives, equation by equation (row-major over equation and regressor)."""
        return tuple(f"{row}_{column}" for row in self.equations for column in self.regressors)

    @cached_property
    def all_states(self) -> tuple[str, ...]:
        """States, then attitudes: the rows and columns of A."""
        return self.states + self.attitudes


SHORT_PERIOD = ModeStructure(
    "short_period",
    ("w", "q"),
    ("eta",),
    ("z", "m"),
    "short period, 2 degrees of freedom (thesis table 3.1)",
    oscillations=("short_period",),
)
SHORT_PERIOD_ALPHA = ModeStructure(
    "short_period_alpha",
    ("alpha", "q"),
    ("eta",),
    ("z", "m"),
    "short period with angle of attack instead of normal velocity (thesis table 3.1)",
    oscillations=("short_period",),
)
PHUGOID = ModeStructure(
    "phugoid",
    ("u", "theta"),
    ("eta",),
    ("x", "theta"),
    "phugoid: forward velocity and pitch attitude, w and q follow at once (thesis table 3.1)",
    oscillations=("phugoid",),
)
LONGITUDINAL = ModeStructure(
    "longitudinal",
    ("u", "w", "q"),
    ("eta",),
    ("x", "z", "m"),
    "full longitudinal motion (thesis equation 3.17)",
    ("theta",),
    ("short_period", "phugoid"),
)
LONGITUDINAL_THROTTLE = ModeStructure(
    "longitudinal_throttle",
    ("u", "w", "q"),
    ("eta", "tau"),
    ("x", "z", "m"),
    "full longitudinal motion (thesis equation 3.17) with the throttle as second input",
    ("theta",),
    ("short_period", "phugoid"),
)
DUTCH_ROLL = ModeStructure(
    "dutch_roll",
    ("v", "r"),
    ("zeta",),
    ("y", "n"),
    "Dutch roll, 2 degrees of freedom (thesis table 3.1)",
    oscillations=("dutch_roll",),
)
DUTCH_ROLL_BETA = ModeStructure(
    "dutch_roll_beta",
    ("beta", "r"),
    ("zeta",),
    ("y", "n"),
    "Dutch roll with sideslip instead of lateral velocity (thesis table 3.1)",
    oscillations=("dutch_roll",),
)
ROLL = ModeStructure(
    "roll",
    ("p",),
    ("xi",),
    ("l",),
    "roll subsidence, 1 degree of freedom (thesis table 3.1)",
    subsidences=("roll",),
)
SPIRAL = ModeStructure(
    "spiral",
    ("phi",),
    ("zeta",),
    ("phi",),
    "spiral: bank, v, p and r follow at once (thesis table 3.1)",
    subsidences=("spiral",),
)
LATERAL = ModeStructure(
    "lateral",
    ("v", "p", "r"),
    ("xi", "zeta"),
    ("y", "l", "n"),
    "lateral, 4 degrees of freedom with bank angle through gravity (thesis equation B.12)",
    oscillations=("dutch_roll",),
    subsidences=("roll",),
)
LATERAL_FULL = ModeStructure(
    "lateral_full",
    ("v", "p", "r"),
    ("xi", "zeta"),
    ("y", "l", "n"),
    "full lateral motion with bank and heading (thesis equation 3.18)",
    ("phi", "psi"),
    ("dutch_roll",),
    ("roll", "spiral"),
)

STRUCTURES: Mapping[str, ModeStructure] = {s.name: s for s in (SHORT_PERIOD, DUTCH_ROLL, LATERAL)}
"""The structures that are estimated on streams, expected, compared and stored, by name."""

MODEL_STRUCTURES: Mapping[str, ModeStructure] = {
    s.name: s
    for s in (
        SHORT_PERIOD, SHORT_PERIOD_ALPHA, PHUGOID, LONGITUDINAL, LONGITUDINAL_THROTTLE,
        DUTCH_ROLL, DUTCH_ROLL_BETA, ROLL, SPIRAL, LATERAL, LATERAL_FULL,
    )
}  # fmt: skip
"""Every structure there is, by name: those of ``STRUCTURES`` and the further ones of thesis 3.3."""
