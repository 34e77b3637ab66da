"""Model structures: which states, inputs and equations a mode's linear model has (thesis 3.3)."""

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["ModeStructure", "SHORT_PERIOD", "DUTCH_ROLL", "LATERAL", "STRUCTURES"]


@dataclass(frozen=True, slots=True)
class ModeStructure:
    """The linear model of one mode: ``dx/dt = A x + B u + constant``, row by row.

    Attributes:
        name: key in every interface, such as ``short_period``.
        states: symbols of the states whose columns the equations have.
        inputs: symbols of the control inputs (eta elevator, xi aileron, zeta rudder).
        equations: first letters of the equations, in the order of their own states.
        description: one line.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    equations: tuple[str, ...]
    description: str

    @property
    def regressors(self) -> tuple[str, ...]:
        """States, then inputs: the columns of every equation."""
        return self.states + self.inputs

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Symbols of all derivatives, equation by equation (row-major over equation and regressor)."""
        return tuple(f"{row}_{column}" for row in self.equations for column in self.regressors)


SHORT_PERIOD = ModeStructure(
    "short_period", ("w", "q"), ("eta",), ("z", "m"), "short period, 2 degrees of freedom (thesis table 3.1)"
)
DUTCH_ROLL = ModeStructure(
    "dutch_roll", ("v", "r"), ("zeta",), ("y", "n"), "Dutch roll, 2 degrees of freedom (thesis table 3.1)"
)
LATERAL = ModeStructure(
    "lateral",
    ("v", "p", "r"),
    ("xi", "zeta"),
    ("y", "l", "n"),
    "lateral, 4 degrees of freedom with bank angle through gravity (thesis equation B.12)",
)

STRUCTURES: Mapping[str, ModeStructure] = {s.name: s for s in (SHORT_PERIOD, DUTCH_ROLL, LATERAL)}
"""Every structure, by name."""
